"""How runs become one row of a table."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import numpy as np

from robot.lab.task import Result
from robot.store.table import Cell

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


SSD_COLUMNS = (
    *("runs", "mean", "sd", "median", "max", "move never made"),
    *("of moves made, median", "of frequent moves, median", "against lesson, median"),
    *("stuck", "longest push s", "pushing s/min", "collisions/min", "asked", "metres", "floor m2"),
)
"""What `ssd_cells` gives."""


def ssd_cells(drives: Sequence[Result]) -> tuple[Cell, ...]:
    """Return the figures of many runs' drives, in the order of `SSD_COLUMNS`."""

    def values(name: str) -> list[float]:
        return [drive[name] for drive in drives]

    ssds = values("ssd")
    return (
        *(len(ssds), statistics.fmean(ssds), deviation(ssds), statistics.median(ssds), max(ssds)),
        sum(bool(drive["never"]) for drive in drives),
        statistics.median(values("ssd_of_moves_made")),
        statistics.median(values("ssd_frequent")),
        statistics.median(values("ssd_against_lesson")),
        sum(bool(drive["stuck"]) for drive in drives),
        max(values("longest_push_s")),
        statistics.fmean(values("pushing_s_per_min")),
        statistics.fmean(values("collisions_per_min")),
        percent(statistics.fmean(values("asking_share"))),
        statistics.fmean(values("driven_m")),
        statistics.fmean(values("covered_m2")),
    )
