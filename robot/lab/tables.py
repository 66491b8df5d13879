"""How runs become one row of a table."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from robot.lab.task import Result
from robot.store.table import Cell, Table, format_cell

__all__ = ["SSD_COLUMNS", "Cell", "Spread", "Table", "format_cell", "spread", "ssd_cells"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A summary of some numbers."""

    mean: float
    sd: float
    median: float
    max: float
    n: int


def spread(values: Sequence[float]) -> Spread:
    """Return mean, standard deviation (of a sample; 0 for one), median and maximum."""
    return Spread(
        mean=statistics.fmean(values),
        sd=statistics.stdev(values) if len(values) > 1 else 0.0,
        median=statistics.median(values),
        max=max(values),
        n=len(values),
    )


SSD_COLUMNS = (
    *("runs", "mean", "sd", "median", "max", "move never made"),
    *("of moves made, median", "of frequent moves, median", "against lesson, median"),
    *("stuck", "longest push s", "pushing s/min", "collisions/min", "asked", "metres", "floor m2"),
)
"""What `ssd_cells` gives."""


def ssd_cells(drives: Sequence[Result]) -> tuple[Cell, ...]:
    """Return the figures of many runs' drives, in the order of `SSD_COLUMNS`."""
    total = spread([drive["ssd"] for drive in drives])
    return (
        total.n,
        total.mean,
        total.sd,
        total.median,
        total.max,
        sum(bool(drive["never"]) for drive in drives),
        spread([drive["ssd_of_moves_made"] for drive in drives]).median,
        spread([drive["ssd_frequent"] for drive in drives]).median,
        spread([drive["ssd_against_lesson"] for drive in drives]).median,
        sum(bool(drive["stuck"]) for drive in drives),
        max(drive["longest_push_s"] for drive in drives),
        statistics.fmean(drive["pushing_s_per_min"] for drive in drives),
        statistics.fmean(drive["collisions_per_min"] for drive in drives),
        f"{100 * statistics.fmean(drive['asking_share'] for drive in drives):.0f} %",
        statistics.fmean(drive["driven_m"] for drive in drives),
        statistics.fmean(drive["covered_m2"] for drive in drives),
    )
