"""What an experiment is: a plan of tasks, and the tables made of their results."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from robot.lab.tables import Table
from robot.lab.task import Result, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentSettings:
    """The options of a run of experiments."""

    seeds: int = 10
    quick: bool = False
    learners: tuple[str, ...] = ()
    """Empty: those of the experiment."""
    teacher: str | None = None
    """None: those of the experiment."""
    delays_ms: tuple[int, ...] = (0, 100, 300)
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
    """Lines or bars over common x values, for matplotlib."""

    title: str
    x_label: str
    y_label: str
    series: tuple[tuple[str, tuple[float | str, ...], tuple[float, ...]], ...]
    """Name, x values, y values."""
    log_y: bool = False


class Experiment(ABC):
    """One figure of the paper, or one question beyond it."""

    name: str
    title: str
    text: str

    @abstractmethod
    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Return the tasks to run."""

    @abstractmethod
    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return the results as tables."""

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return the results as plots; none where the tables are enough."""
        return []


def group(
    tasks: Sequence[Task], results: Sequence[Result], *names: str
) -> dict[tuple[object, ...], list[Result]]:
    """Sort results by the parameters of these names, in the order of the tasks."""
    groups: dict[tuple[object, ...], list[Result]] = {}
    for task, result in zip(tasks, results, strict=True):
        groups.setdefault(tuple(task.params.get(name) for name in names), []).append(result)
    return groups
