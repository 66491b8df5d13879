"""How runs become the rows of a table."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from robot.lab.task import Result
from robot.store.table import Cell, Table

_DRAWS = 2000
"""Of the bootstrap that the intervals come from."""


def deviation(values: Sequence[float]) -> float:
    """Return the standard deviation of a sample; 0 for one."""
    return statistics.stdev(values) if len(values) > 1 else 0.0


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval of the mean of some runs, by bootstrap; the same on every call."""
    sample = np.asarray(values, dtype=float)
    draws = np.random.default_rng(0).choice(sample, (_DRAWS, sample.size)).mean(axis=1)
    low, high = np.quantile(draws, (0.025, 0.975))
    return float(low), float(high)


def mean_in_interval(values: Sequence[float], digits: int = 2) -> str:
    """Return the mean of some runs as text, and its interval in brackets."""
    low, high = (f"{end:.{digits}f}" for end in interval(values))
    return f"{statistics.fmean(values):.{digits}f} [{low}, {high}]"


def percent(share: float, digits: int = 0) -> str:
    return f"{100 * share:.{digits}f} %"


Columns = Mapping[str, Callable[[Sequence[Result]], Cell]]
"""How each cell of a row is made of the row's results, by the column's title."""


def of(name: str, join: Callable[[list[Any]], Cell]) -> Callable[[Sequence[Result]], Cell]:
    """Return how a cell is made of one figure of all results."""
    return lambda results: join([result[name] for result in results])


def mean_percent(shares: Sequence[float]) -> str:
    return percent(statistics.fmean(shares), 1)


def table_of(
    title: str, head: str, rows: Mapping[Any, Sequence[Result]], columns: Columns
) -> Table:
    """Return a table with a row for each name and its results; the names stand below `head`."""
    lines = (
        (str(name), *(cell(results) for cell in columns.values())) for name, results in rows.items()
    )
    return Table(title=title, columns=(head, *columns), rows=tuple(lines))


SSD_COLUMNS: Columns = {
    "runs": len,
    "mean": of("ssd", statistics.fmean),
    "sd": of("ssd", deviation),
    "median": of("ssd", statistics.median),
    "max": of("ssd", max),
    "move never made": of("never", lambda moves: sum(map(bool, moves))),
    "of moves made, median": of("ssd_of_moves_made", statistics.median),
    "of frequent moves, median": of("ssd_frequent", statistics.median),
    "against lesson, median": of("ssd_against_lesson", statistics.median),
    "stuck": of("stuck", sum),
    "longest push s": of("longest_push_s", max),
    "pushing s/min": of("pushing_s_per_min", statistics.fmean),
    "collisions/min": of("collisions_per_min", statistics.fmean),
    "asked": of("asking_share", lambda shares: percent(statistics.fmean(shares))),
    "metres": of("driven_m", statistics.fmean),
    "floor m2": of("covered_m2", statistics.fmean),
}
