"""Defines an experiment: a plan of tasks, and the tables of their results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Any

from robot.errors import ConfigurationError
from robot.lab.task import Params, Result, Task
from robot.study.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentSettings:
    """The options of a run of experiments."""

    seeds: int = 10
    quick: bool = False
    learners: Sequence[str] = ()
    """Learners to run; if empty, the experiment's own learners."""
    teacher: str | None = None
    """Teacher to use; if None, the experiment's own teacher."""
    recordings: str | None = None
    worlds: Sequence[str] = ()
    """Third-party worlds to use; if empty, the experiment's own worlds."""
    robot: str = "sim"
    """The robot whose cycles are timed for figure 5."""

    @property
    def n_seeds(self) -> int:
        """Number of runs of each kind; 1 with `--quick`."""
        return 1 if self.quick else self.seeds

    def taught(self, place: Params) -> Params:
        """Return the parameters of a place, with the teacher of the settings, if they have one."""
        return {**place, "teacher": self.teacher or place["teacher"]}

    @property
    def learner(self) -> str:
        """The learner, for experiments that accept only one. Raises ConfigurationError if the
        settings contain several."""
        if len(self.learners) > 1:
            raise ConfigurationError(
                "habits, ready and degrees take only one --learner, not " + ", ".join(self.learners)
            )
        return self.learners[0] if self.learners else "default-32"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """A plot for matplotlib: lines over numbers, or one point for each name.

    Attributes:
        series: For each series its name, the x values or names, and the y values; None for a
            missing value.
    """

    title: str
    x_label: str = ""
    y_label: str = ""
    series: Sequence[tuple[str, Sequence[Any], Sequence[Any]]]


Runs = Sequence[tuple[Task, Result]]


def seeded(
    run: Callable[[Params], Result],
    cases: Iterable[Params],
    settings: ExperimentSettings,
    first: int = 0,
    least: int = 1,
) -> Iterator[Task]:
    """Yield each case with several successive seeds, beginning with `first`. There are as many
    seeds as the settings say, and at least `least`."""
    for case in cases:
        for seed in range(max(least, settings.n_seeds)):
            yield Task(run, {**case, "seed": first + seed})


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """An experiment that answers one question: it repeats a figure of the paper, or goes beyond it.

    Attributes:
        plan: Makes the tasks to run.
        tables: Makes the tables of the results.
        drawn: Columns of each table that are also plotted, with one position on the horizontal axis
            for each row.
        plots: Makes plots in addition to those of `drawn`.
        times_machine: True if the experiment measures computing time. Its runs are then made on
            this machine, one after the other.
    """

    title: str
    text: str
    plan: Callable[[ExperimentSettings], Iterable[Task]]
    tables: Callable[[Runs], list[Table]]
    drawn: tuple[str, ...] = ()
    plots: Callable[[Runs], list[Plot]] = lambda runs: []
    times_machine: bool = False


def group(runs: Runs, *names: str) -> dict[tuple[Any, ...], list[Result]]:
    """Group results by the values of the parameters `names`. The groups keep the order of the
    tasks."""
    groups: dict[tuple[Any, ...], list[Result]] = {}
    for task, result in runs:
        groups.setdefault(tuple(task.params.get(name) for name in names), []).append(result)
    return groups


EXPERIMENTS = {
    "figure3": "robot.lab.figure3:FIGURE3",
    "figure5": "robot.lab.figure5:FIGURE5",
    "figure6": "robot.lab.lessons:FIGURE6",
    "figure7": "robot.lab.lessons:FIGURE7",
    "figure8": "robot.lab.lessons:FIGURE8",
    "behaviours": "robot.lab.behaviours:BEHAVIOURS",
    "ablation": "robot.lab.ablation:ABLATION",
    "habits": "robot.lab.habits:GATE",
    "ready": "robot.lab.ready:READY",
    "mind": "robot.lab.mind:MIND",
    "degrees": "robot.lab.proportional:PROPORTIONAL",
    "ground": "robot.lab.ground.ground:GROUND",
    "streams": "robot.lab.streams:ONLINE",
}
"""The module and the name that define each experiment, in the order of `drivelesson experiment
all`."""


def load_experiment(name: str) -> Experiment:
    """Return an experiment; raises MissingExtraError if a library is missing."""
    experiment: Experiment = resolve_name(EXPERIMENTS[name])
    return experiment
