"""Makes tables from the results of runs."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from operator import getitem
from typing import Any

from robot.lab.chance import deviation
from robot.lab.task import Result
from robot.study.table import Cell, Table


def percent(share: float, digits: int = 0) -> str:
    return f"{100 * share:.{digits}f} %"


Columns = Mapping[str, Callable[[Sequence[Result]], Cell]]
"""Columns of a table: maps each title to the function that computes a cell from the results of a
row."""


def of(name: str, join: Callable[[list[Any]], Cell]) -> Callable[[Sequence[Result]], Cell]:
    """Return a function that computes a cell from the results of a row. `name` is a measure, such
    as `ssd` or `teacher.ssd`."""
    return lambda results: join([reduce(getitem, name.split("."), each) for each in results])


def mean_percent(shares: Sequence[float]) -> str:
    return percent(statistics.fmean(shares), 1)


def tables_of(
    results: Iterable[tuple[str, str, Result]], columns: Columns, head: str = ""
) -> list[Table]:
    """Return tables of some results, each given with the title of its table and the name of its
    row.

    Tables and rows are in the order of the results. `head` is the heading of the first column,
    which contains the names of the rows.
    """
    tables: dict[str, dict[str, list[Result]]] = {}
    for title, row, result in results:
        tables.setdefault(title, {}).setdefault(row, []).append(result)
    return [
        Table(
            title=title,
            columns=(head, *columns),
            rows=tuple(
                (row, *(cell(own) for cell in columns.values())) for row, own in rows.items()
            ),
        )
        for title, rows in tables.items()
    ]


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
