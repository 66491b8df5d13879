"""A process measured from outside, and growth printed as a table."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path

from tests.soak.slopes import slope


def measure_process(pid: int, memory: str = "Rss") -> dict[str, float]:
    """Return resident (Rss) or proportional (Pss) MB, handles, threads and CPU s of a process.

    Raises:
        OSError: If it has ended.
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
    """Return the size of all files below a folder, without those that are gone meanwhile."""

    def size(path: Path) -> int:
        with contextlib.suppress(OSError):
            return path.stat().st_size if path.is_file() else 0
        return 0

    return sum(map(size, folder.rglob("*"))) / 1e6


def describe_growth(times_s: Sequence[float], rows: Sequence[dict[str, float]]) -> list[str]:
    """Return a table: each figure but CPU time at first and at last, and its growth in an hour."""
    lines = [f"{'':16} {'at first':>10} {'at last':>10} {'an hour':>10}  95 % of the slope"]
    for name in (name for name in rows[0] if not name.endswith("CPU s")):
        values = [row[name] for row in rows]
        line = slope(times_s, values)
        grows = "" if line.is_flat else "  GROWS" if line.hourly > 0 else ""
        lines.append(
            f"{name:16} {values[0]:10.1f} {values[-1]:10.1f} {line.hourly:+10.2f}  "
            f"+-{line.margin:.2f}{grows}"
        )
    return lines
