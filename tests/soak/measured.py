"""Measures a process from outside, and prints the growth of its figures as a table."""

from __future__ import annotations

import contextlib
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

_SKIPPED_S = 300.0
"""Measurements count from this time on, in seconds; in a shorter run, after a quarter of it."""


def measure_process(pid: int, memory: str = "Rss") -> dict[str, float]:
    """Return a process's resident (Rss) or proportional (Pss) MB, handles, threads and CPU seconds.

    Raises:
        OSError: If the process has ended.
    """
    place = Path(f"/proc/{pid}")
    used = (place / "stat").read_text().rpartition(")")[2].split()
    mapped = (place / "smaps_rollup").read_text().splitlines()
    kilobytes = next(int(line.split()[1]) for line in mapped if line.startswith(f"{memory}:"))
    return {
        "memory MB": kilobytes / 1024,
        "handles": len(list((place / "fd").iterdir())),
        "threads": len(list((place / "task").iterdir())),
        "CPU s": (int(used[11]) + int(used[12])) / os.sysconf("SC_CLK_TCK"),
    }


def disk_mb(folder: Path) -> float:
    """Return the size of all files below a folder, except files that disappear meanwhile."""
    total = 0
    for path in folder.rglob("*"):
        with contextlib.suppress(OSError):
            total += path.stat().st_size if path.is_file() else 0
    return total / 1e6


class Slope(NamedTuple):
    """Growth of a figure per hour, and half the width of its 95 % interval."""

    hourly: float
    margin: float

    @property
    def is_flat(self) -> bool:
        """True if the interval includes no growth."""
        return abs(self.hourly) <= self.margin


def slope(times_s: ArrayLike, values: ArrayLike) -> Slope:
    """Fit a line by least squares; correlated neighbours widen the interval (Bartlett)."""
    t, y = np.asarray(times_s, float) / 3600, np.asarray(values, float)
    if len(t) < 4 or np.ptp(t) == 0:
        return Slope(math.nan, math.inf)
    hourly, start = np.polyfit(t, y, 1)
    rest = y - (hourly * t + start)
    spread = float((rest**2).sum())
    alike = float((rest[1:] * rest[:-1]).sum() / spread) if spread else 0.0
    alike = min(max(alike, 0.0), 0.95)
    deviation = math.sqrt(spread / (len(t) - 2) / (len(t) * float(t.var())))
    return Slope(float(hourly), 1.96 * deviation * math.sqrt((1 + alike) / (1 - alike)))


class Growth:
    """Measures figures at regular times."""

    def __init__(self, every_s: float, figures: Callable[[], dict[str, float]]) -> None:
        self._every_s, self._figures = every_s, figures
        self._began_s = time.monotonic()
        self._times_s: list[float] = []
        self._rows: list[dict[str, float]] = []

    def measure_if_due(self) -> None:
        """Measure if a measurement is due. Print the figures every five minutes, in case the run
        ends early."""
        now_s = time.monotonic() - self._began_s
        if now_s >= len(self._rows) * self._every_s:
            self._times_s.append(now_s)
            self._rows.append(row := self._figures())
            if len(self._rows) % round(300 / self._every_s) == 0:
                told = ", ".join(f"{name} {value:.1f}" for name, value in row.items())
                print(f"after {now_s / 60:.0f} minutes: {told}", file=sys.stderr, flush=True)

    def _kept(self) -> slice:
        skipped_s = min(_SKIPPED_S, self._times_s[-1] / 4)
        return slice(sum(at_s < skipped_s for at_s in self._times_s), None)

    def gain(self, name: str) -> float:
        """Return the growth of a figure over the counted measurements."""
        kept = self._rows[self._kept()]
        return kept[-1][name] - kept[0][name]

    def table(self) -> str:
        """Return the first and last value and the growth per hour of all figures but CPU time."""
        lines = [f"{'':16} {'at first':>10} {'at last':>10} {'an hour':>10}  95 % of the slope"]
        times_s, rows = self._times_s[self._kept()], self._rows[self._kept()]
        for name in (name for name in rows[0] if not name.endswith(("CPU s", "pictures"))):
            values = [row[name] for row in rows]
            line = slope(times_s, values)
            grows = "  GROWS" if line.hourly > 0 and not line.is_flat else ""
            lines.append(
                f"{name:16} {values[0]:10.1f} {values[-1]:10.1f} {line.hourly:+10.2f}  "
                f"+-{line.margin:.2f}{grows}"
            )
        return "\n".join(lines)
