"""What an experiment is: a plan of tasks, and the tables made of their results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from robot.lab.task import Params, Result, Task
from robot.store.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentSettings:
    """The options of a run of experiments."""

    seeds: int = 10
    quick: bool = False
    learners: tuple[str, ...] = ()
    """Empty: those of the experiment."""
    teacher: str | None = None
    """None: those of the experiment."""
    recordings: str | None = None
    worlds: tuple[str, ...] = ()
    """Foreign worlds; empty: those of the experiment."""
    robot: str = "sim"
    """Whose cycles figure 5 times."""

    @property
    def n_seeds(self) -> int:
        """How many runs of each kind; one with `--quick`."""
        return 1 if self.quick else self.seeds


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """Lines over numbers, or points beside names, for matplotlib.

    Attributes:
        series: Name, x values or names, y values; None where there is none.
    """

    title: str
    x_label: str = ""
    y_label: str = ""
    series: Sequence[tuple[str, Sequence[Any], Sequence[Any]]]


Runs = Sequence[tuple[Task, Result]]


def seeded(
    run: Callable[[Params], Result], cases: Iterable[Params], settings: ExperimentSettings
) -> Iterator[Task]:
    """Yield each case with every seed, from 0 on."""
    for case in cases:
        for seed in range(settings.n_seeds):
            yield Task(run, {**case, "seed": seed})


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """One figure of the paper, or one question beyond it.

    Attributes:
        plan: Makes the tasks to run.
        tables: Makes the tables of what was run.
        drawn: Columns of each table that are plotted over its rows.
        plots: Makes further plots.
        times_machine: Its runs are made one after the other, here.
    """

    title: str
    text: str
    plan: Callable[[ExperimentSettings], Iterable[Task]]
    tables: Callable[[Runs], list[Table]]
    drawn: tuple[str, ...] = ()
    plots: Callable[[Runs], list[Plot]] = lambda runs: []
    times_machine: bool = False


def group(runs: Runs, *names: str) -> dict[tuple[Any, ...], list[Result]]:
    """Sort results by the parameters of these names, in the order of the tasks."""
    groups: dict[tuple[Any, ...], list[Result]] = {}
    for task, result in runs:
        groups.setdefault(tuple(task.params.get(name) for name in names), []).append(result)
    return groups
