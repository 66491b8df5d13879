"""Tables of figures, as text for a terminal; and how runs become one row."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from robot.lab.task import Result

Cell = str | float | int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table with a title and a note."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def as_text(self) -> str:
        """Return the table with its columns aligned."""
        lines = [self.columns, *([format_cell(cell) for cell in row] for row in self.rows)]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        texts = [
            "  ".join(
                cell.ljust(width) if i == 0 else cell.rjust(width)
                for i, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        ]
        rule = "-" * max(len(text) for text in texts)
        note = [self.note] if self.note else []
        return "\n".join([self.title, rule, texts[0], rule, *texts[1:], *note])


def format_cell(cell: Cell) -> str:
    """Return a cell as text: numbers with two digits, nothing as a dash."""
    if cell is None:
        return "-"
    if isinstance(cell, float):
        return f"{cell:.2f}"
    return str(cell)


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
