"""Experiments in which robots are taught, and held against their teachers by SSD.

Figures 6, 7 and 8 of the paper.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from robot.control.profile import Profile, compare
from robot.lab import metrics
from robot.lab.experiment import Experiment, ExperimentSettings, Runs, seeded
from robot.lab.ideas import make_learner, make_pilot
from robot.lab.metrics import DriveLog
from robot.lab.published import FIGURE_6, FIGURE_7, FIGURE_8
from robot.lab.tables import SSD_COLUMNS, tables_of
from robot.lab.task import Params, Result
from robot.lab.trial import Trial
from robot.store.table import Cell, Table
from robot.types import Action, Mode

TRIALS: dict[int, dict[str, Any]] = {
    1: {"world": "box", "moves": ("forward", "left"), "teacher": "usual"},
    2: {"world": "office", "moves": ("forward", "left"), "teacher": "usual"},
    3: {"world": "office", "moves": ("forward", "left", "right"), "teacher": "habit"},
}
"""The paper's places and moves; the teachers are ours."""
_RETRAINED = {"teach_s": 90.0, "correct_s": 330.0, "alone_s": 60.0}
_SONAR = {"world": "box", "moves": ("forward", "left"), "teacher": "sonar"}


def run_lesson(params: Params) -> Result:
    """Teach, drive alone, correct, drive alone again; figures of each phase.

    Parameters: `world`, `learner`, `teacher`, `moves`, `seed`, `teach_s`, `correct_s`, `alone_s`,
    `reference_s` (how long the teacher drives once more so that its own profile is well known;
    nothing is measured of the robot after it).
    """
    moves = tuple(Action(move) for move in params["moves"])
    alone_s = float(params.get("alone_s", 60.0))
    with Trial(
        params["world"],
        params["seed"],
        make_learner(params["learner"], moves),
        make_pilot(params, moves),
    ) as trial:
        taught = trial.drive(Mode.TRAIN, params["teach_s"])
        drives = {"before": trial.drive(Mode.AUTONOMOUS, alone_s, supervised=False)}
        if params.get("correct_s"):
            trial.drive(Mode.AUTONOMOUS, params["correct_s"])
            drives["after"] = trial.drive(Mode.AUTONOMOUS, alone_s, supervised=False)
        n_nodes, lessons = trial.policy.n_nodes, dict(trial.loop.state.taught)
        again = trial.drive(Mode.TRAIN, params.get("reference_s", 240.0))
        timing = trial.timing()
    teacher = DriveLog([*taught, *again])
    result: Result = {
        name: _figures(drive, teacher, taught.profile(), moves) for name, drive in drives.items()
    }
    result["teacher"] = _figures(again.last(alone_s), teacher, taught.profile(), moves)
    result["taught"] = {"agreement": metrics.agreement(taught), "nodes": n_nodes}
    result["taught"]["lessons"] = {move.value: n for move, n in sorted(lessons.items())}
    result["timing"] = timing
    return result


def _figures(
    drive: DriveLog, teacher: DriveLog, taught: Profile, moves: tuple[Action, ...]
) -> dict[str, Any]:
    """Return all figures of one drive; `taught` is the teaching alone, as in the paper."""
    return {
        **metrics.against(drive, teacher, moves),
        "ssd_against_lesson": compare(taught, drive.profile(), moves).ssd,
        "collisions_per_min": metrics.collisions_per_minute(drive),
        "pushing_s_per_min": metrics.pushing_s_per_minute(drive),
    }


def ssd_tables(
    results: Iterable[tuple[str, str, Result]], *published: tuple[str, str, tuple[Cell, ...]]
) -> list[Table]:
    """Return tables of SSD, each with the paper's rows (title, name, figures) before ours."""
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

NODES, KINDS = tuple(FIGURE_6), ("published", "default")


def _by_nodes(settings: ExperimentSettings) -> Iterable[Params]:
    """A learner that is named has its own number of nodes."""
    own = [(f"{kind}-{nodes}", kind, nodes) for kind in KINDS for nodes in NODES]
    teacher = settings.teacher or "sonar"
    for learner, kind, nodes in [(name, name, 0) for name in settings.learners] or own:
        case = {**_SONAR, "teacher": teacher, "learner": learner, "kind": kind, "nodes": nodes}
        yield {**case, "teach_s": 90.0}


def _tables_by_nodes(runs: Runs) -> list[Table]:
    title = "SSD by nodes"
    rows = [
        (title, f"{p['kind']}, {p['nodes']} nodes" if p["nodes"] else p["kind"], result["before"])
        for p, result in ((task.params, result) for task, result in runs)
    ]
    return ssd_tables(rows, *((title, f"{n} nodes", paper) for n, paper in FIGURE_6.items()))


FIGURE6 = Experiment(
    title="Figure 6: nodes",
    text="In the box, the sonar controller (below 20 cm or bumped: left for two seconds, else "
    "forward) drives for 90 s, then the robot drives 60 s alone; nobody corrects it.",
    plan=lambda settings: seeded(run_lesson, _by_nodes(settings), settings),
    tables=_tables_by_nodes,
    drawn=("mean",),
)

# Figure 7 -----------------------------------------------------------------------------------------


def trial_cases(
    trial: int, learners: Iterable[str], settings: ExperimentSettings
) -> Iterable[Params]:
    """One of the paper's trials, with retraining."""
    setting = {**TRIALS[trial], **_RETRAINED, "trial": trial}
    for learner in learners:
        yield {**setting, "teacher": settings.teacher or setting["teacher"], "learner": learner}


def _trials(settings: ExperimentSettings) -> Iterable[Params]:
    for trial in TRIALS:
        more = ("published-128", "default-128") if trial == 3 else ()
        learners = settings.learners or ("published-32", "default-32", *more)
        yield from trial_cases(trial, learners, settings)


def _tables_by_trial(runs: Runs) -> list[Table]:
    """Return a table a trial, of the minutes before and after retraining and of the teachers'."""
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
        for trial, phases in FIGURE_7.items()
        for phase, (mean, sd, largest) in phases.items()
    )
    return ssd_tables([*rows, *teachers], *paper)


FIGURE7 = Experiment(
    title="Figure 7: retraining",
    text="90 s of teaching, 60 s alone (before), 330 s in which the pilot corrects, 60 s alone "
    "(after). Trial 1: box, FORWARD and LEFT. Trial 2: office, the same moves. Trial 3: "
    "office, RIGHT as well. The robot is held against the profile of all that its teacher "
    "drove (teaching and 4 minutes more, of which the robot learns nothing that is measured); "
    "'against lesson' holds it against the 90 s of teaching alone. The row 'teacher' is the "
    "teacher's own last minute: less than that is chance.",
    plan=lambda settings: seeded(run_lesson, _trials(settings), settings),
    tables=_tables_by_trial,
    drawn=("median", "mean"),
)

# Figure 8 -----------------------------------------------------------------------------------------

SECONDS = (90, 180)


def _by_time(settings: ExperimentSettings) -> Iterable[Params]:
    places = [("robot", _SONAR), *(("human", trial) for trial in TRIALS.values())]
    for learner in settings.learners or ("published-32", "default-32"):
        for who, place in places:
            for seconds in SECONDS:
                yield {**place, "who": who, "learner": learner, "teach_s": float(seconds)}


def _tables_by_time(runs: Runs) -> list[Table]:
    title, name = "SSD by training time", "{learner}, {who}, {teach_s:.0f} s".format_map
    rows = ((title, name(task.params), result["before"]) for task, result in runs)
    paper = ((title, f"{who}, {s} s", (mean,)) for (who, s), mean in FIGURE_8.items())
    return ssd_tables(rows, *paper)


FIGURE8 = Experiment(
    title="Figure 8: training time",
    text="60 s alone straight after 90 s or 180 s of teaching. 'robot': the sonar controller in "
    "the box. 'human': simulated people in the three trials of figure 7, before any correction.",
    plan=lambda settings: seeded(run_lesson, _by_time(settings), settings),
    tables=_tables_by_time,
    drawn=("mean",),
)
