"""Measures every fault in every mode, and writes docs/reference/faults.md (`make docs`)."""

from __future__ import annotations

import gc
import hashlib
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat

from . import bodies
from .scenario import outcomes
from .table import FAULTS, MODES, PAGE, render

Cell = tuple[int, str]


def worst_ms(cell: Cell, n_seeds: int) -> float:
    """Return the longest time until the robot stood."""
    number, mode = cell
    found = outcomes(FAULTS[number], mode, range(n_seeds))
    gc.collect()
    return 1000 * max(outcome.stood_after_s for outcome in found)


def measure(n_seeds: int) -> dict[tuple[str, str], float]:
    """Return the worst time of this number of drives for each fault and mode, and print the
    duration.

    A drive leaves few reference cycles, and collecting them would take a seventh of its time.
    """
    numbered = [(number, mode) for number in range(len(FAULTS)) for mode in MODES]
    cells = [(FAULTS[number].name, mode) for number, mode in numbered]
    bodies_cells = [(name, fault) for name in bodies.BODIES for fault in bodies.FAULTS]
    n_drives = min(n_seeds, bodies.DRIVES)
    with ProcessPoolExecutor(initializer=gc.disable) as pool:
        started_s = time.monotonic()
        measured = dict(zip(cells, pool.map(worst_ms, numbered, repeat(n_seeds)), strict=True))
        _tell("faults in modes", len(cells), n_seeds, started_s)
        started_s = time.monotonic()
        figures = pool.map(bodies.worst_ms, *zip(*bodies_cells, strict=True), repeat(n_drives))
        measured |= zip(bodies_cells, figures, strict=True)
        _tell("bodies", len(bodies_cells), n_drives, started_s)
    return measured


def _tell(what: str, n_cells: int, n_drives: int, started_s: float) -> None:
    took_s = time.monotonic() - started_s
    print(f"{what}: {n_cells} cells, {n_drives} drives each, in {took_s:.1f} s")


if __name__ == "__main__":
    figures = measure(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
    PAGE.write_text(render(figures))
    print(f"sha256 of all figures: {hashlib.sha256(repr(figures).encode()).hexdigest()}")
