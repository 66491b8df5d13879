"""Measures every fault in every mode, and writes the tables of docs/reference/faults.md.

`python -m tests.faults.page` measures all figures again; `make docs` keeps the measured figures.
"""

from __future__ import annotations

import gc
import re
import sys
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from pathlib import Path

from . import bodies
from .scenario import outcomes
from .table import FAULTS, LIMIT_S, MODES

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "faults.md"
_UNWATCHED = (
    "| `ros` without the watchdog | stops when its base stops it | stops when its base stops it "
    "| stops when its base stops it | only the robot's base: see [ROS 2](../howto/ros.md) |"
)
Cell = tuple[str, str]
"""The key of a cell: a fault and a mode, or a body and a fault."""
_BY_NAME = {fault.name: fault for fault in FAULTS}
_CELLS: list[Cell] = [
    *((name, mode) for name in _BY_NAME for mode in MODES),
    *((name, fault) for name in bodies.BODIES for fault in bodies.FAULTS),
]


def worst_ms(cell: Cell, n_seeds: int) -> float:
    """Return the longest time until the robot stood, in milliseconds."""
    name, column = cell
    if name in _BY_NAME:
        found = outcomes(_BY_NAME[name], column, range(n_seeds))
        gc.collect()
        return 1000 * max(outcome.stood_after_s for outcome in found)
    drives = range(min(n_seeds, bodies.DRIVES))
    return 1000 * max(bodies.stood_after_s(name, column, seed) for seed in drives)


def measure(n_seeds: int) -> dict[Cell, float]:
    """Return the worst time of this number of drives for each cell.

    Garbage collection is off, because a drive leaves few reference cycles, and searching for them
    takes a seventh of the time.
    """
    with ProcessPoolExecutor(initializer=gc.disable) as pool:
        return dict(zip(_CELLS, pool.map(worst_ms, _CELLS, repeat(n_seeds)), strict=True))


def render(page: str, measured_ms: Mapping[Cell, float] | None = None) -> str:
    """Return the page with updated tables; if no new figures are given, they keep the old ones."""
    known = _figures(page) if measured_ms is None else measured_ms

    def row(first: str, name: str, columns: tuple[str, ...], last: str) -> str:
        limit = f"stops within {1000 * LIMIT_S:.0f} ms"
        figures = (known.get((name, column)) for column in columns)
        cells = (limit + ("" if ms is None else f" ({ms:.0f})") for ms in figures)
        return f"| {' | '.join((first, *cells, last))} |"

    faults = [
        row(fault.title, fault.name, MODES, " or ".join(f"`{reason}`" for reason in fault.reasons))
        for fault in FAULTS
    ]
    stopped_by = [
        row(f"`{name}`", name, bodies.FAULTS, by) for name, (_, by) in bodies.BODIES.items()
    ]
    tables = {"fault | in": faults, "body | link lost": [*stopped_by, _UNWATCHED]}
    for head, rows in tables.items():
        table = rf"(?m)(^\| {re.escape(head)} .*\n\|[-|]+\n)(?:^\|.*\n)+"
        page = re.sub(table, r"\1" + "\n".join(rows) + "\n", page)
    return page


def _figures(page: str) -> dict[Cell, float]:
    """Return the figures in the page."""
    rows = {fault.title: (fault.name, MODES) for fault in FAULTS}
    rows |= {f"`{name}`": (name, bodies.FAULTS) for name in bodies.BODIES}
    found = {}
    for line in page.splitlines():
        first, *cells = line.strip("| ").split(" | ")
        name, columns = rows.get(first, ("", ()))
        for column, cell in zip(columns, cells, strict=False):
            if figure := re.search(r"\((\d+)\)$", cell):
                found[name, column] = float(figure[1])
    return found


if __name__ == "__main__":
    measured = measure(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
    PAGE.write_text(render(PAGE.read_text("utf-8"), measured), "utf-8")
