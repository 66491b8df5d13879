"""Thirty simulated robots under one board: how long STOP ALL takes, and what board and page cost.

The robots are real servers in a few processes; the board is `drivelesson board` in a process of its
own; its page is shown by a Chromium, where STOP ALL is pressed. Times are taken in the robots'
control loops, from just before the press. Needs Chromium.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError
from robot.store.table import Table
from server.board.class_key import keep_class_key
from server.cli.output import numbers_in
from server.cli.parser import number, whole
from server.lab.bench.browser import DevToolsPage, running_browser
from server.lab.bench.process import BenchProcess
from server.lab.bench.report import add_json, percentile, report

_ALL_THERE = "document.querySelectorAll('.robot[data-status=there]').length"
_DRAWN = (
    "[...document.querySelectorAll('.seen')].reduce((n, e) => n + Number(e.dataset.frames ?? 0), 0)"
)
_TICKS = os.sysconf("SC_CLK_TCK")
_PATIENCE_S = 60.0


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--robots", type=whole(1, 60), default=30, help="how many (%(default)s)")
    parser.add_argument("--processes", type=whole(1, 30), default=2, help="for them (%(default)s)")
    parser.add_argument(
        "--rate", type=number(above=0), default=10.0, help="their pictures a second (%(default)s)"
    )
    parser.add_argument(
        "--pictures", default="1,10", help="pictures a second on the board (%(default)s)"
    )
    parser.add_argument("--seconds", type=number(above=0), default=10.0, help="for each")
    parser.add_argument("--stops", type=whole(1), default=10, help="presses for each (%(default)s)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    rates_hz = numbers_in(args.pictures, float, "--pictures")
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        key = Path(folder) / "class.key"
        keep_class_key(key)
        n, of = args.robots, args.processes
        shares = [n // of + (i < n % of) for i in range(of)]
        robots = [
            stack.enter_context(BenchProcess("classroom", share, args.rate, key))
            for share in filter(None, shares)
        ]
        rows = [_measure(robots, key, rate_hz, args) for rate_hz in rates_hz]
    return report(args, rows, _table(rows, args))


def _table(rows: list[dict[str, Any]], args: argparse.Namespace) -> Table:
    presses = [press for row in rows for press in row["stops"]]
    loads = [press["load"] for press in presses]
    return Table(
        title=f"{args.robots} robots, {rows[0]['robots_hz']:.1f} pictures a second each",
        columns=(
            *("board's pictures/s", "drawn/s", "p50 ms", "p95 ms", "worst ms"),
            *("board", "page", "Chromium"),
        ),
        rows=tuple(
            (
                f"{row['pictures_hz']:g}",
                *(f"{row[key]:.0f}" for key in ("drawn_per_s", "p50_ms", "p95_ms", "slowest_ms")),
                *(f"{row[key]:.1%}" for key in ("board", "page", "chromium")),
            )
            for row in rows
        ),
        note=f"p50, p95, worst: of {args.stops} presses of STOP ALL, until the last robot stood.\n"
        f"At least {min(press['driving'] for press in presses)} of {args.robots} drove then.\n"
        "board, page, Chromium: share of one core; page is its main thread.\n"
        f"The machine's load was {min(loads):.1f} to {max(loads):.1f} on {os.cpu_count()} cores.",
    )


def _ask(robots: list[BenchProcess], word: str) -> list[dict[str, Any]]:
    """Send a command to all, and return what each robot reports."""
    return [row for process in robots for row in process.ask(word)]


def _measure(
    robots: list[BenchProcess], key: Path, pictures_hz: float, args: argparse.Namespace
) -> dict[str, Any]:
    ports = [port for process in robots for port in process.first]
    with _board(ports, key, pictures_hz) as (address, pid), running_browser() as page:
        page.send(
            "Emulation.setDeviceMetricsOverride",
            width=1920,
            height=1080,
            deviceScaleFactor=1,
            mobile=False,
        )
        page.send("Page.navigate", url=address)
        page.wait_for(f"{_ALL_THERE} === {args.robots}", _PATIENCE_S)
        _ask(robots, "drive")
        time.sleep(3.0)
        before, board_s, browser_s = page.metrics(), _cpu_s(pid), page.processes_cpu_s()
        drawn, start_s = float(page.evaluate(_DRAWN)), time.monotonic()
        time.sleep(args.seconds)
        lasted_s = time.monotonic() - start_s
        after = page.metrics()
        row = {
            "pictures_hz": pictures_hz,
            "drawn_per_s": (float(page.evaluate(_DRAWN)) - drawn) / lasted_s,
            "board": (_cpu_s(pid) - board_s) / lasted_s,
            "page": (after["TaskDuration"] - before["TaskDuration"]) / lasted_s,
            "chromium": (page.processes_cpu_s() - browser_s) / lasted_s,
            "robots_hz": sum(r["rate_hz"] for r in _ask(robots, "report")) / args.robots,
        }
        presses = [_stop_all(robots, page, args.robots) for _ in range(args.stops)]
    times_ms = [press["ms"] for press in presses]
    return {
        **row,
        "stops": presses,
        "p50_ms": percentile(times_ms, 50),
        "p95_ms": percentile(times_ms, 95),
        "slowest_ms": max(times_ms),
    }


def _stop_all(robots: list[BenchProcess], page: DevToolsPage, count: int) -> dict[str, float]:
    """Press STOP ALL; return after how many ms the last robot had latched, and how many drove."""
    deadline_s = time.monotonic() + _PATIENCE_S / 3
    while len(_driving(_ask(robots, "drive"))) < count and time.monotonic() < deadline_s:
        time.sleep(1.0)  # a busy machine stops some of them again
    point = page.middle_of(".stop.shown")
    driving = len(_driving(_ask(robots, "report")))
    pressed_s = time.monotonic()
    for kind in ("mousePressed", "mouseReleased"):
        page.send("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **point)
    time.sleep(1.5)
    rows = _ask(robots, "report")
    missed = [row for row in rows if row["latched_s"] is None]
    if missed:
        raise ConfigurationError(f"{len(missed)} robots were not stopped within 1.5 s")
    last_s = max(max(row["latched_s"], row["moved_s"] or 0.0) for row in rows)
    return {
        "ms": round(1000 * float(last_s - pressed_s), 1),
        "driving": driving,
        "load": os.getloadavg()[0],
    }


def _driving(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the robots whose wheels were told to turn within the last half second."""
    now_s = time.monotonic()
    return [row for row in rows if row["moved_s"] and now_s - row["moved_s"] < 0.5]


@contextlib.contextmanager
def _board(ports: list[int], key: Path, pictures_hz: float) -> Iterator[tuple[str, int]]:
    listed = ",".join(f"127.0.0.1:{port}" for port in ports)
    words = [sys.executable, "-m", "server", "board", "--robots", listed, "--port", "0"]
    process = subprocess.Popen(
        [*words, "--class-key", str(key), "--pictures", str(pictures_hz)],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        if found is None:
            raise ConfigurationError("the board did not start; see above")
        yield found[0], process.pid
    finally:
        process.terminate()
        process.communicate(timeout=20)


def _cpu_s(pid: int) -> float:
    """Return the CPU time of a process, as Linux counts it."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS
