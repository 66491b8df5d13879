"""Serves, teaches and hands over for some minutes, and reports growth: outside CI.

`python -m tests.soak --minutes 60`: a real server with the simulator; a pilot teaches for 20 s and
hands over for 10, again and again; viewers connect, watch, stall and vanish. The report has the
growth per hour with intervals, from the fifth minute on (or from a quarter of a shorter run), and
the time to read the journal at the end. `--lessons 20000` adds a year of lessons in virtual time.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

from tests.kit.ports import free_port
from tests.server.live_robot import Pilot
from tests.soak.lessons import year
from tests.soak.measured import describe_growth, disk_mb, measure_process

ROOT = Path(__file__).parents[2]
MOVES = ("forward", "left", "forward", "right")
EVERY_S = 5.0


class Served:
    """A server in a separate process, measured from outside."""

    def __init__(self, folder: Path, rate_hz: float) -> None:
        self.port = free_port()
        self.folder, self._objects = folder, folder / "objects"
        began_s = time.monotonic()
        self.process = subprocess.Popen(
            [
                *(sys.executable, "-m", "tests.soak.server", "serve", "--no-page"),
                *("--robot", "sim", "--port", str(self.port), "--data", str(folder / "data")),
                *("--frame-rate-hz", str(rate_hz)),
            ],
            cwd=ROOT,
            env={**os.environ, "SOAK_OBJECTS": str(self._objects)},
            stdout=subprocess.DEVNULL,
            stderr=(folder / "log").open("ab"),
        )
        while True:
            with contextlib.suppress(OSError):
                urllib.request.urlopen(f"http://127.0.0.1:{self.port}/", timeout=5).close()
                break
            time.sleep(0.1)
        self.ready_s = time.monotonic() - began_s

    def measure(self) -> dict[str, float]:
        return {
            **measure_process(self.process.pid),
            "objects": self._count(),
            "disk MB": disk_mb(self.folder / "data"),
        }

    def peak_mb(self) -> float:
        """Return the highest resident memory so far, in MB."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) / 1024

    def _count(self) -> int:
        self._objects.unlink(missing_ok=True)
        self.process.send_signal(signal.SIGUSR1)
        for _ in range(100):
            with contextlib.suppress(OSError, ValueError):
                return int(self._objects.read_text())
            time.sleep(0.05)
        return 0

    def stop(self) -> float:
        """End it as a system does; return the time that takes, in seconds."""
        began_s = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(60)
        return time.monotonic() - began_s


def come_and_go(served: Served, ending: threading.Event) -> None:
    """Viewers, one after the other: some leave, some vanish."""
    chance = random.Random(1)
    while not ending.wait(chance.uniform(0.2, 1.5)):
        with contextlib.suppress(Exception):
            viewer = Pilot(f"ws://127.0.0.1:{served.port}/ws/drive", sees=chance.random() < 0.5)
            viewer.is_silent = True
            ending.wait(chance.uniform(0.2, 2.0))
            if chance.random() < 0.3:
                viewer.vanish()
            viewer.close()


def drive(pilot: Pilot, minutes: float) -> Iterator[None]:
    """Teach for 20 s, hand over for 10, and yield at each time of a measurement."""
    end_s, due_s = time.monotonic() + minutes * 60, time.monotonic()
    turn = 0
    while time.monotonic() < end_s:
        wanted = "train" if turn % 30 < 20 else "autonomous"
        if pilot.states and pilot.state["mode"] != wanted:
            pilot.mode(wanted)
        pilot.hold(MOVES[turn // 2 % len(MOVES)] if wanted == "train" else None)
        turn += 1
        time.sleep(1.0)
        del pilot.messages[:-50]
        if time.monotonic() >= due_s:
            due_s += EVERY_S
            yield


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=30.0, metavar="HZ", help="pictures a second")
    parser.add_argument("--lessons", type=int, default=0, help="of a year in virtual time")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        served = Served(Path(name), args.rate)
        ending = threading.Event()
        viewers = threading.Thread(target=come_and_go, args=(served, ending), daemon=True)
        viewers.start()
        times_s: list[float] = []
        rows: list[dict[str, float]] = []
        pictures: list[int] = []
        pilot = Pilot(f"ws://127.0.0.1:{served.port}/ws/drive", sees=True)
        began_s = time.monotonic()
        for _ in drive(pilot, args.minutes):
            times_s.append(time.monotonic() - began_s)
            rows.append(served.measure())
            pictures.append(pilot.picture or 0)
            if len(rows) % 60 == 0:  # every five minutes: the run may be ended early
                told = ", ".join(f"{name} {value:.1f}" for name, value in rows[-1].items())
                print(f"{times_s[-1] / 60:.0f} minutes: {told}", file=sys.stderr, flush=True)
        lessons = pilot.state["lessons"]
        ending.set()
        pilot.close()
        viewers.join(10)
        ended_s = served.stop()
        again = Served(Path(name), args.rate)
        recovery_s = again.ready_s
        again.stop()
    skipped_s = min(300.0, times_s[-1] / 4)
    kept = [index for index, time_s in enumerate(times_s) if time_s >= skipped_s]
    print(f"{args.minutes:g} minutes, {pictures[-1]} pictures, {lessons} lessons")
    for line in describe_growth([times_s[i] for i in kept], [rows[i] for i in kept]):
        print(line)
    spent = rows[kept[-1]]["CPU s"] - rows[kept[0]]["CPU s"]
    seen = max(pictures[kept[-1]] - pictures[kept[0]], 1)
    print(f"CPU a picture {1000 * spent / seen:.2f} ms; SIGTERM {ended_s:.1f} s; ", end="")
    print(f"started in {served.ready_s:.1f} s, at the end in {recovery_s:.1f} s")
    if args.lessons:
        print(year(args.lessons))
    return 0


if __name__ == "__main__":
    sys.exit(main())
