"""Experiments in which robots are taught, and held against their teachers by SSD.

Figures 6, 7 and 8 of the paper, and beyond it: delays, other moves, and the default's parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from robot.lab.experiment import Experiment, ExperimentSettings, Plot, group
from robot.lab.published import FIGURE_6, FIGURE_7, FIGURE_8
from robot.lab.tables import SSD_COLUMNS, Cell, Table, spread, ssd_cells
from robot.lab.task import Result, Task
from robot.lab.variants import VARIANTS

Params = Mapping[str, Any]
Groups = Mapping[tuple[Any, ...], list[Result]]
TRIALS: dict[int, dict[str, Any]] = {
    1: {"world": "box", "moves": ("forward", "left"), "teacher": "usual"},
    2: {"world": "office", "moves": ("forward", "left"), "teacher": "usual"},
    3: {"world": "office", "moves": ("forward", "left", "right"), "teacher": "habit"},
}
"""The paper's places and moves; the teachers are ours."""
_RETRAINED = {"teach_s": 90.0, "correct_s": 330.0, "alone_s": 60.0}
_SONAR = {"world": "box", "moves": ("forward", "left"), "teacher": "sonar"}


@dataclass(frozen=True, kw_only=True)
class Lessons(Experiment):
    """Cases, each taught with every seed, and the SSD of those that belong together as a row.

    Attributes:
        cases: The parameters of each case, without the seed.
        names: Parameters by which runs are put together.
        title_of, label_of: The table and the row of such a group, of its parameters.
        published: Rows of the paper by table, put before ours.
        phases: Which minutes alone are shown, each in a row of its own.
        with_agreement: Whether the agreement after teaching has a column.
        with_teacher: Whether each table ends with the teachers' own last minutes.
        curves: The series of the plot, of the groups; with its title and labels in `axes`.
    """

    name: str
    title: str
    text: str
    cases: Callable[[ExperimentSettings], Iterable[Params]]
    names: tuple[str, ...]
    title_of: Callable[..., str]
    label_of: Callable[..., str]
    published: Mapping[str, Sequence[tuple[Cell, ...]]] = field(default_factory=dict)
    phases: tuple[str, ...] = ("before",)
    with_agreement: bool = False
    with_teacher: bool = False
    axes: tuple[str, str, str] = ("", "", "")
    log_y: bool = False
    curves: Callable[[Groups], list[tuple[str, tuple[Any, ...], tuple[float, ...]]]] | None = None

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan each case with every seed."""
        return [
            Task(kind="lesson", params={**case, "seed": seed})
            for case in self.cases(settings)
            for seed in range(settings.n_seeds)
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return the groups' rows by table."""
        rows = {
            title: [(*row, *(None,) * (1 + len(SSD_COLUMNS) - len(row))) for row in rows]
            for title, rows in self.published.items()
        }
        teachers: dict[str, list[Result]] = {}
        for key, runs in group(tasks, results, *self.names).items():
            table = rows.setdefault(self.title_of(*key), [])
            for phase in self.phases:
                label = ", ".join((self.label_of(*key), *([phase] if self.phases[1:] else [])))
                more = [run["taught"]["agreement"] for run in runs] if self.with_agreement else []
                mean = (spread(more).mean,) if more else ()
                table.append((label, *mean, *ssd_cells([run[phase] for run in runs])))
            if self.with_teacher:
                teachers.setdefault(self.title_of(*key), []).extend(run["teacher"] for run in runs)
        for title, drives in teachers.items():
            rows[title].append(("teacher", *ssd_cells(drives)))
        agreement = ("agreement",) if self.with_agreement else ()
        columns = ("SSD", *agreement, *SSD_COLUMNS)
        return [Table(title=t, columns=columns, rows=tuple(lines)) for t, lines in rows.items()]

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return the one plot, if there is one."""
        if self.curves is None:
            return []
        title, x_label, y_label = self.axes
        series = tuple(self.curves(group(tasks, results, *self.names)))
        labels = {"x_label": x_label, "y_label": y_label}
        return [Plot(title=title, series=series, log_y=self.log_y, **labels)]


def _mean(runs: Sequence[Result]) -> float:
    return spread([run["before"]["ssd"] for run in runs]).mean


# Figure 6 -----------------------------------------------------------------------------------------

NODES, KINDS = tuple(FIGURE_6), ("published", "default")


def _by_nodes(settings: ExperimentSettings) -> Iterable[Params]:
    """A learner that is named has its own number of nodes."""
    own = [(f"{kind}-{nodes}", kind, nodes) for kind in KINDS for nodes in NODES]
    teacher = settings.teacher or "sonar"
    for learner, kind, nodes in [(name, name, 0) for name in settings.learners] or own:
        case = {**_SONAR, "teacher": teacher, "learner": learner, "kind": kind, "nodes": nodes}
        yield {**case, "teach_s": 90.0}


FIGURE6 = Lessons(
    name="figure6",
    title="Figure 6: nodes",
    text="In the box, the sonar controller (below 20 cm or bumped: left for two seconds, else "
    "forward) drives for 90 s, then the robot drives 60 s alone; nobody corrects it.",
    cases=_by_nodes,
    names=("kind", "nodes"),
    title_of=lambda kind, nodes: "SSD by nodes",
    label_of=lambda kind, nodes: f"{kind}, {nodes} nodes" if nodes else str(kind),
    published={
        "SSD by nodes": [
            (f"paper, {nodes} nodes", None, *figures) for nodes, figures in FIGURE_6.items()
        ]
    },
    axes=("SSD, self-trained", "nodes", "mean SSD"),
    log_y=True,
    curves=lambda groups: [
        *(
            (kind, NODES, tuple(_mean(groups[kind, nodes]) for nodes in NODES))
            for kind in dict.fromkeys(kind for kind, _ in groups if kind in KINDS)
        ),
        ("paper", NODES, tuple(mean for mean, _ in FIGURE_6.values())),
    ],
)

# Figure 7 -----------------------------------------------------------------------------------------


def _trial(trial: int, learners: Iterable[str], settings: ExperimentSettings) -> Iterable[Params]:
    """One of the paper's trials, with retraining."""
    setting = {**TRIALS[trial], **_RETRAINED, "trial": trial}
    for learner in learners:
        yield {**setting, "teacher": settings.teacher or setting["teacher"], "learner": learner}


def _trials(settings: ExperimentSettings) -> Iterable[Params]:
    for trial in TRIALS:
        more = ("published-128", "default-128") if trial == 3 else ()
        yield from _trial(
            trial, settings.learners or ("published-32", "default-32", *more), settings
        )


def _title_of_trial(trial: int, *_: object) -> str:
    return f"Trial {trial}: {TRIALS[trial]['world']}, {', '.join(TRIALS[trial]['moves'])}"


def _after_retraining(groups: Groups) -> list[tuple[str, tuple[str, ...], tuple[float, ...]]]:
    series = []
    for learner in dict.fromkeys(str(learner) for _, learner in groups):
        mine = {f"trial {trial}": runs for (trial, name), runs in groups.items() if name == learner}
        medians = (spread([run["after"]["ssd"] for run in runs]).median for runs in mine.values())
        series.append((learner, tuple(mine), tuple(medians)))
    paper = tuple(figures["after"][0] for figures in FIGURE_7.values())
    return [*series, ("paper (mean)", tuple(f"trial {trial}" for trial in FIGURE_7), paper)]


FIGURE7 = Lessons(
    name="figure7",
    title="Figure 7: retraining",
    text="90 s of teaching, 60 s alone (before), 330 s in which the pilot corrects, 60 s alone "
    "(after). Trial 1: box, FORWARD and LEFT. Trial 2: office, the same moves. Trial 3: "
    "office, RIGHT as well. The robot is held against the profile of all that its teacher "
    "drove (teaching and 4 minutes more, of which the robot learns nothing that is measured); "
    "'against lesson' holds it against the 90 s of teaching alone. The row 'teacher' is the "
    "teacher's own last minute: less than that is chance.",
    cases=_trials,
    names=("trial", "learner"),
    title_of=_title_of_trial,
    label_of=lambda trial, learner: str(learner),
    published={
        _title_of_trial(trial): [
            (f"paper, {phase}", None, mean, sd, None, largest)
            for phase, (mean, sd, largest) in phases.items()
        ]
        for trial, phases in FIGURE_7.items()
    },
    phases=("before", "after"),
    with_teacher=True,
    axes=("After retraining", "", "median SSD"),
    log_y=True,
    curves=_after_retraining,
)

# Figure 8 -----------------------------------------------------------------------------------------

SECONDS = (90, 180)


def _by_time(settings: ExperimentSettings) -> Iterable[Params]:
    places = [("robot", _SONAR), *(("human", trial) for trial in TRIALS.values())]
    for learner in settings.learners or ("published-32", "default-32"):
        for who, place in places:
            for seconds in SECONDS:
                yield {**place, "who": who, "learner": learner, "teach_s": float(seconds)}


FIGURE8 = Lessons(
    name="figure8",
    title="Figure 8: training time",
    text="60 s alone straight after 90 s or 180 s of teaching. 'robot': the sonar controller in "
    "the box. 'human': simulated people in the three trials of figure 7, before any correction.",
    cases=_by_time,
    names=("learner", "who", "teach_s"),
    title_of=lambda *_: "SSD by training time",
    label_of=lambda learner, who, seconds: f"{learner}, {who}, {seconds:.0f} s",
    published={
        "SSD by training time": [
            (f"paper, {who}, {seconds} s", None, mean) for (who, seconds), mean in FIGURE_8.items()
        ]
    },
    axes=("Training time", "", "mean SSD"),
    curves=lambda groups: [
        *(
            (
                learner,
                tuple(f"{who} {seconds} s" for who, seconds in FIGURE_8),
                tuple(_mean(groups[learner, who, float(seconds)]) for who, seconds in FIGURE_8),
            )
            for learner in dict.fromkeys(str(learner) for learner, *_ in groups)
        ),
        (
            "paper",
            tuple(f"{who} {seconds} s" for who, seconds in FIGURE_8),
            tuple(FIGURE_8.values()),
        ),
    ],
)

# Beyond the paper ---------------------------------------------------------------------------------

_NAMED = {True: "the frame on the screen", False: "the newest frame"}


def _by_delay(settings: ExperimentSettings) -> Iterable[Params]:
    for learner in settings.learners or ("default-32",):
        for trial in (1, 2):
            for delay_ms in settings.delays_ms:
                for named in _NAMED:
                    case = {**TRIALS[trial], "trial": trial, "learner": learner, "teach_s": 90.0}
                    yield {**case, "delay_ms": delay_ms, "names_frame": named}


def _against_delay(groups: Groups) -> list[tuple[str, tuple[int, ...], tuple[float, ...]]]:
    series = []
    delays = tuple(dict.fromkeys(int(ms) for _, _, ms, _ in groups))
    for named, name in _NAMED.items():
        medians = []
        for delay_ms in delays:
            runs = [r for key, some in groups.items() if key[2:] == (delay_ms, named) for r in some]
            medians.append(spread([run["before"]["ssd"] for run in runs]).median)
        series.append((f"label on {name}", delays, tuple(medians)))
    return series


DELAY = Lessons(
    name="delay",
    title="Delay: does naming the frame help?",
    text="Box and office with two moves: 90 s of teaching over a link with a delay (half for the "
    "picture, half for the command), 60 s alone. The label goes to the frame that the "
    "command names, which is the one on the screen, or to the newest frame when the command "
    "comes. The pilot's own reaction time of 0.2 s is there in every run. The governor, "
    "which forbids learning over slow links, is switched off for this question.",
    cases=_by_delay,
    names=("trial", "learner", "delay_ms", "names_frame"),
    title_of=lambda trial, *_: f"Delay: {TRIALS[trial]['world']}",
    label_of=lambda trial, learner, ms, named: f"{learner}, {ms} ms, {_NAMED[bool(named)]}",
    with_agreement=True,
    axes=("Link delay", "ms", "median SSD"),
    curves=_against_delay,
)

_SETS = {
    "about one wheel": ("forward", "left", "right"),
    "on the spot": ("forward", "spin_left", "spin_right"),
}


def _by_moves(settings: ExperimentSettings) -> Iterable[Params]:
    place = {"world": "office", "teacher": settings.teacher or "habit"}
    for how, moves in _SETS.items():
        for learner in settings.learners or ("default-32",):
            case = {**place, "moves": moves, "how": how, "learner": learner}
            yield {**case, "teach_s": 90.0, "correct_s": 330.0}


MOVES = Lessons(
    name="moves",
    title="Beyond the paper: other moves",
    text="The office with the teacher of trial 3, who turns about one wheel, and with the same "
    "teacher spinning on the spot. 90 s of teaching, 330 s of correction, 60 s alone.",
    cases=_by_moves,
    names=("learner", "how"),
    title_of=lambda *_: "Moves, after retraining",
    label_of=lambda learner, how: f"{learner}, turns {how}",
    phases=("after",),
)

ABLATED = ("default", *(kind for kind in VARIANTS if kind != "whole-numbers"), "published")


def _without_parts(settings: ExperimentSettings) -> Iterable[Params]:
    for trial, nodes in ((2, 32), (3, 128)):
        yield from _trial(trial, [f"{kind}-{nodes}" for kind in ABLATED], settings)


ABLATION = Lessons(
    name="ablation",
    title="Ablation in closed loop",
    text="As figure 7 after retraining: trial 2 with 32 nodes, trial 3 with 128. Each row has one "
    "part of the default learner changed (robot/policy/variants.py).",
    cases=_without_parts,
    names=("trial", "learner"),
    title_of=lambda trial, learner: f"Trial {trial} after retraining",
    label_of=lambda trial, learner: str(learner),
    phases=("after",),
)
