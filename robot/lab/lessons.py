"""Experiments in which robots are taught, and then compared with their teachers by the sum of
squared differences (SSD) of their driving profiles.

The experiments repeat figures 6, 7 and 8 of the paper.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from robot.lab import metrics
from robot.lab.experiment import Experiment, ExperimentSettings, Runs, seeded
from robot.lab.ideas import make_trial
from robot.lab.metrics import DriveLog
from robot.lab.tables import SSD_COLUMNS, tables_of
from robot.lab.task import Params, Result
from robot.study.profile import compare
from robot.study.table import Cell, Table
from robot.types import Mode

TRIALS: dict[int, dict[str, Any]] = {
    1: {"world": "box", "moves": ("forward", "left"), "teacher": "usual"},
    2: {"world": "office", "moves": ("forward", "left"), "teacher": "usual"},
    3: {"world": "office", "moves": ("forward", "left", "right"), "teacher": "habit"},
}
"""The paper's three trials. Places and moves are those of the paper; the teachers are our own."""
_RETRAINED = {"teach_s": 90.0, "correct_s": 330.0, "alone_s": 60.0}
_SONAR = {"world": "box", "moves": ("forward", "left"), "teacher": "sonar"}


def run_lesson(params: Params) -> Result:
    """Teach a robot, let it drive unaided, correct it, and let it drive unaided again. Return the
    measures of each phase.

    Parameters: `world`, `learner`, `teacher`, `moves`, `seed`, `teach_s`, `correct_s`, `alone_s`,
    `reference_s`. At the end the teacher drives for another `reference_s` seconds, so that the
    teacher's profile is reliable.
    """
    alone_s = params.get("alone_s", 60.0)
    with make_trial(params) as trial:
        moves = trial.policy.moves
        taught, drives = trial.lesson(params["teach_s"], params.get("correct_s", 0.0), alone_s)
        again = trial.drive(Mode.TRAIN, params.get("reference_s", 240.0))
    teacher = DriveLog([*taught, *again])
    drives["teacher"] = again.last(alone_s)
    result: Result = {
        name: {
            **metrics.against(drive, teacher, moves),
            # As in the paper, compare the robot only with the lesson that it was taught.
            "ssd_against_lesson": compare(taught.profile(), drive.profile(), moves).ssd,
        }
        for name, drive in drives.items()
    }
    result["taught"] = {"agreement": metrics.agreement(taught)}
    result["timing"] = trial.timing
    return result


def ssd_tables(
    results: Iterable[tuple[str, str, Result]], *published: tuple[str, str, tuple[Cell, ...]]
) -> list[Table]:
    """Return tables of SSD. In each table the paper's rows (title, name, numbers) come before our
    own rows."""
    made = []
    for table in tables_of(results, SSD_COLUMNS, "SSD"):
        missing = (None,) * len(SSD_COLUMNS)
        paper = [
            (f"paper, {name}", None, *figures, *missing[1 + len(figures) :])
            for title, name, figures in published
            if title == table.title
        ]
        made.append(replace(table, rows=(*paper, *table.rows)))
    return made


# Figure 6 -----------------------------------------------------------------------------------------

_NODES_PUBLISHED = {
    2: (31.74, 17.28),
    4: (11.62, 10.36),
    8: (4.40, 7.68),
    16: (2.87, 4.34),
    32: (3.48, 5.84),
    64: (12.20, 10.57),
}
"""The paper's sum of squared differences (SSD) for each number of nodes: mean and standard
deviation. The robot was taught by a controller with a sonar."""
KINDS = ("published", "default")


def _by_nodes(settings: ExperimentSettings) -> Iterable[Params]:
    own = [f"{kind}-{nodes}" for kind in KINDS for nodes in _NODES_PUBLISHED]
    for learner in settings.learners or own:
        yield {**settings.taught(_SONAR), "learner": learner, "teach_s": 90.0}


def _tables_by_nodes(runs: Runs) -> list[Table]:
    title = "SSD by nodes"
    rows = [(title, task.params["learner"], result["before"]) for task, result in runs]
    return ssd_tables(
        rows, *((title, f"{n} nodes", paper) for n, paper in _NODES_PUBLISHED.items())
    )


FIGURE6 = Experiment(
    title="Figure 6: nodes",
    text="In the box, the sonar controller drives for 90 s: left for two seconds if it bumped or "
    "the distance is below 20 cm, otherwise forward. Then the robot drives for 60 s without "
    "corrections.",
    plan=lambda settings: seeded(run_lesson, _by_nodes(settings), settings),
    tables=_tables_by_nodes,
    drawn=("mean",),
)

# Figure 7 -----------------------------------------------------------------------------------------


_TRIALS_PUBLISHED = {
    1: {"before": (9.40, 12.95, 44.90), "after": (1.77, 1.77, 6.96)},
    2: {"before": (14.24, 12.15, 46.76), "after": (1.72, 1.93, 7.50)},
    3: {"before": (20.47, 16.42, 65.56), "after": (10.84, 15.21, 86.79)},
}
"""The paper's sum of squared differences (SSD) for each trial, with 32 nodes and human teachers:
mean, standard deviation, maximum."""


def trial_cases(
    trial: int, learners: Iterable[str], settings: ExperimentSettings
) -> Iterable[Params]:
    """Return the parameters of one run for each learner: the paper's trial with this number, with
    retraining."""
    for learner in learners:
        yield {**settings.taught(TRIALS[trial]), **_RETRAINED, "trial": trial, "learner": learner}


def _trials(settings: ExperimentSettings) -> Iterable[Params]:
    for trial in TRIALS:
        more = ("published-128", "default-128") if trial == 3 else ()
        learners = settings.learners or ("published-32", "default-32", *more)
        yield from trial_cases(trial, learners, settings)


def _tables_by_trial(runs: Runs) -> list[Table]:
    """Return one table for each trial. Its rows describe one minute each: of the robot before
    retraining, of the robot after retraining, and of the teacher."""
    titles = {
        trial: f"Trial {trial}: {setting['world']}, {', '.join(setting['moves'])}"
        for trial, setting in TRIALS.items()
    }
    own = [(titles[task.params["trial"]], task.params["learner"], result) for task, result in runs]
    rows = [
        (title, f"{learner}, {phase}", result[phase])
        for title, learner, result in own
        for phase in ("before", "after")
    ]
    teachers = [(title, "teacher", result["teacher"]) for title, _, result in own]
    paper = (
        (titles[trial], phase, (mean, sd, None, largest))
        for trial, phases in _TRIALS_PUBLISHED.items()
        for phase, (mean, sd, largest) in phases.items()
    )
    return ssd_tables([*rows, *teachers], *paper)


FIGURE7 = Experiment(
    title="Figure 7: retraining",
    text="90 s of teaching, 60 s unaided (before), 330 s in which the pilot corrects, 60 s unaided "
    "(after). Trial 1: box, FORWARD and LEFT. Trial 2: office, the same moves. Trial 3: "
    "office, also RIGHT. The robot is compared with the profile of all that its teacher drove "
    "(the teaching and 4 more minutes, which do not affect the measured robot); 'against "
    "lesson' compares it only with the 90 s of teaching. The row 'teacher' compares the "
    "teacher's own last minute with that profile; smaller differences are chance.",
    plan=lambda settings: seeded(run_lesson, _trials(settings), settings),
    tables=_tables_by_trial,
    drawn=("median", "mean"),
)

# Figure 8 -----------------------------------------------------------------------------------------

_TIMES_PUBLISHED = {
    ("robot", 90): 12.41,
    ("robot", 180): 8.21,
    ("human", 90): 11.79,
    ("human", 180): 9.38,
}
"""The paper's mean SSD by teacher and seconds of training."""
SECONDS = (90, 180)


def _by_time(settings: ExperimentSettings) -> Iterable[Params]:
    trials = [("human", settings.taught(trial)) for trial in TRIALS.values()]
    places = [("robot", _SONAR), *trials]
    for learner in settings.learners or ("published-32", "default-32"):
        for who, place in places:
            for seconds in SECONDS:
                yield {**place, "who": who, "learner": learner, "teach_s": float(seconds)}


def _tables_by_time(runs: Runs) -> list[Table]:
    title, name = "SSD by training time", "{learner}, {who}, {teach_s:.0f} s".format_map
    rows = ((title, name(task.params), result["before"]) for task, result in runs)
    paper = ((title, f"{who}, {s} s", (mean,)) for (who, s), mean in _TIMES_PUBLISHED.items())
    return ssd_tables(rows, *paper)


FIGURE8 = Experiment(
    title="Figure 8: training time",
    text="60 s unaided after 90 s or 180 s of teaching, without corrections. 'robot': taught by "
    "the sonar controller in the box. 'human': taught by simulated people in the three trials "
    "of figure 7.",
    plan=lambda settings: seeded(run_lesson, _by_time(settings), settings),
    tables=_tables_by_time,
    drawn=("mean",),
)
