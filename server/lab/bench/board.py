"""Thirty simulated robots under one board: how long STOP ALL takes, and what board and page cost.

The robots are real servers in a few processes; the board is `drivelesson board` in a process of its
own; its page is shown by a Chromium, where STOP ALL is pressed. Times are taken in the robots'
control loops, from just before the press. Needs Chromium.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
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
from server.board.class_key import keep_class_key
from server.cli.parser import number, whole
from server.lab.bench.page import DevToolsPage, running_browser

_ALL_THERE = "document.querySelectorAll('.robot[data-status=there]').length"
_DRAWN = (
    "[...document.querySelectorAll('.seen')].reduce((n, e) => n + Number(e.dataset.frames ?? 0), 0)"
)
_TICKS = os.sysconf("SC_CLK_TCK")
_PATIENCE_S = 60.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
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
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Measure, and print a table or JSON."""
    try:
        rates = [float(rate) for rate in args.pictures.split(",")]
    except ValueError as error:
        raise ConfigurationError(f"--pictures expects numbers, not {args.pictures!r}") from error
    with tempfile.TemporaryDirectory() as folder:
        key = Path(folder) / "class.key"
        keep_class_key(key)
        with _class(args.robots, args.processes, args.rate, key) as robots:
            rows = [
                _measure(robots, key, rate, args.seconds, args.stops, args.robots) for rate in rates
            ]
    if args.json:
        print(json.dumps(rows, indent=1))
        return 0
    print("| board's pictures/s | drawn/s | p50 | p95 | worst | board | page | Chromium |")
    print("|---|---|---|---|---|---|---|---|")
    for row in rows:
        print(
            f"| {row['pictures_hz']:g} | {row['drawn_per_s']:.0f} | {row['p50_ms']:.0f} ms"
            f" | {row['p95_ms']:.0f} ms | {row['slowest_ms']:.0f} ms | {row['board']:.1%}"
            f" | {row['page']:.1%} | {row['chromium']:.1%} |"
        )
    print(f"\np50, p95, worst: of {args.stops} presses of STOP ALL, until the last robot stood.")
    driving = min(press["driving"] for row in rows for press in row["stops"])
    print(f"At least {driving} of {args.robots} drove when STOP ALL was pressed.")
    print(f"{args.robots} robots, {rows[0]['robots_hz']:.1f} pictures a second each.")
    print("board, page, Chromium: share of one core; page is its main thread.")
    loads = [press["load"] for row in rows for press in row["stops"]]
    print(f"The machine's load was {min(loads):.1f} to {max(loads):.1f} on {os.cpu_count()} cores.")
    return 0


class _Robots:
    """The processes of the robots."""

    def __init__(self, processes: list[subprocess.Popen[str]]) -> None:
        self._processes = processes
        self.ports = [port for process in processes for port in json.loads(_line(process))]

    def ask(self, word: str) -> list[dict[str, Any]]:
        """Send a command to all, and return what each robot reports."""
        for process in self._processes:
            assert process.stdin is not None
            process.stdin.write(word + "\n")
            process.stdin.flush()
        return [row for process in self._processes for row in json.loads(_line(process))["robots"]]


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise ConfigurationError("the robots' process ended; see above")
    return line


@contextlib.contextmanager
def _class(count: int, processes: int, rate_hz: float, key: Path) -> Iterator[_Robots]:
    shares = [count // processes + (i < count % processes) for i in range(processes)]
    with contextlib.ExitStack() as stack:
        started = []
        for share in filter(None, shares):
            words = [sys.executable, "-m", "server.lab.bench.classroom", str(share), str(rate_hz)]
            process = subprocess.Popen(
                [*words, str(key)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
            stack.callback(process.communicate, timeout=20)
            started.append(process)
        yield _Robots(started)


def _measure(
    robots: _Robots, key: Path, pictures_hz: float, seconds: float, stops: int, count: int
) -> dict[str, Any]:
    with _board(robots.ports, key, pictures_hz) as (address, pid), running_browser() as page:
        page.send(
            "Emulation.setDeviceMetricsOverride",
            width=1920,
            height=1080,
            deviceScaleFactor=1,
            mobile=False,
        )
        page.send("Page.navigate", url=address)
        page.wait_for(f"{_ALL_THERE} === {count}", _PATIENCE_S)
        robots.ask("drive")
        time.sleep(3.0)
        before, board_s, browser_s = page.metrics(), _cpu_s(pid), page.processes_cpu_s()
        drawn, start_s = float(page.evaluate(_DRAWN)), time.monotonic()
        time.sleep(seconds)
        lasted_s = time.monotonic() - start_s
        after = page.metrics()
        row = {
            "pictures_hz": pictures_hz,
            "drawn_per_s": (float(page.evaluate(_DRAWN)) - drawn) / lasted_s,
            "board": (_cpu_s(pid) - board_s) / lasted_s,
            "page": (after["TaskDuration"] - before["TaskDuration"]) / lasted_s,
            "chromium": (page.processes_cpu_s() - browser_s) / lasted_s,
            "robots_hz": sum(r["rate_hz"] for r in robots.ask("report")) / count,
        }
        presses = [_stop_all(robots, page) for _ in range(stops)]
        times_ms = sorted(press["ms"] for press in presses)
        return {
            **row,
            "stops": presses,
            "p50_ms": _share_of(times_ms, 0.5),
            "p95_ms": _share_of(times_ms, 0.95),
            "slowest_ms": times_ms[-1],
        }


def _share_of(times_ms: list[float], share: float) -> float:
    """Return the shortest time that this share of the presses did not exceed."""
    return times_ms[math.ceil(share * len(times_ms)) - 1]


def _stop_all(robots: _Robots, page: DevToolsPage) -> dict[str, float]:
    """Press STOP ALL; return after how many ms the last robot had latched, and how many drove."""
    deadline_s = time.monotonic() + _PATIENCE_S / 3
    while len(_driving(robots.ask("drive"))) < len(robots.ports) and time.monotonic() < deadline_s:
        time.sleep(1.0)  # a busy machine stops some of them again
    box = json.loads(
        page.evaluate(
            "JSON.stringify(document.querySelector('.stop.shown').getBoundingClientRect())"
        )
    )
    point = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    driving = len(_driving(robots.ask("report")))
    pressed_s = time.monotonic()
    for kind in ("mousePressed", "mouseReleased"):
        page.send("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **point)
    time.sleep(1.5)
    rows = robots.ask("report")
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
        found = re.search(r"http://\S+", _line(process))
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
