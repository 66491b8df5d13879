"""Measures every fault in every mode, and writes docs/reference/faults.md (`make docs`)."""

from __future__ import annotations

import gc
import hashlib
import sys
import time
from concurrent.futures import ProcessPoolExecutor

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
    """Return the worst of so many drives for each fault and mode.

    A drive leaves few cycles behind, and looking for them would be a seventh of its time.
    """
    bodies_cells = [(name, fault) for name in bodies.BODIES for fault in bodies.FAULTS]
    cells = [(number, mode) for number in range(len(FAULTS)) for mode in MODES]
    with ProcessPoolExecutor(initializer=gc.disable) as pool:
        figures = pool.map(worst_ms, cells, [n_seeds] * len(cells))
        n_drives = [min(n_seeds, bodies.DRIVES)] * len(bodies_cells)
        of_bodies = pool.map(bodies.worst_ms, *zip(*bodies_cells, strict=True), n_drives)
        measured = {
            (FAULTS[number].name, mode): figure
            for (number, mode), figure in zip(cells, figures, strict=True)
        }
        return measured | dict(zip(bodies_cells, of_bodies, strict=True))


if __name__ == "__main__":
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    started_s = time.monotonic()
    figures = measure(seeds)
    PAGE.write_text(render(figures))
    print(f"{len(figures)} cells, {seeds} drives each, in {time.monotonic() - started_s:.1f} s")
    print(f"sha256 of all figures: {hashlib.sha256(repr(figures).encode()).hexdigest()}")
