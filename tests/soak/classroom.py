"""Lets a class drive for some minutes, and reports growth: outside CI.

`python -m tests.soak.classroom --robots 10 --minutes 60`: `drivelesson class` with simulated
robots, a pupil at each and the teacher at the board. All pupils teach for 20 s and hand over for
10, again and again; every five minutes the teacher stops all robots. The report has the growth of
the robots and of the board, and the longest time until a STOP held all robots.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Self
from urllib.request import Request, urlopen

from server.board.class_key import read_class_key
from tests.kit.wait import wait_until
from tests.server.live_robot import Pilot
from tests.soak.measured import Growth, disk_mb, measure_process
from tests.soak.served import ROOT, teach_and_hand_over

EVERY_S, STOP_EVERY_S = 10.0, 300.0
STARTED_S = 300.0


class Class:
    """A running class: its robots' processes, and its board."""

    def __init__(self, folder: Path, robots: int, port: int) -> None:
        self.board, self._folder, self._count = f"http://127.0.0.1:{port}", folder, robots
        began_s = time.monotonic()
        self.ended_s = 0.0
        words = ["class", "--robots", str(robots), "--host", "127.0.0.1", "--port", str(port)]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "server", *words, "--data", str(folder)],
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=(folder / "log").open("ab"),
        )
        wait_until(self._are_there, "all robots are there", STARTED_S)
        self.started_s = time.monotonic() - began_s
        self.robots = self._now()

    def _are_there(self) -> bool:
        if self.process.poll() is not None:
            raise SystemExit((self._folder / "log").read_text())
        with contextlib.suppress(OSError):
            return [robot["status"] for robot in self._now()] == ["there"] * self._count
        return False

    def _ask(self, path: str, body: object = None) -> Any:
        headers = {"Content-Type": "application/json"}
        data = json.dumps(body).encode() if body else None
        with urlopen(Request(self.board + path, data, headers), timeout=30) as answer:
            return json.load(answer)

    def pupils(self) -> list[Pilot]:
        """Pair a pilot with each robot by the code on paper."""
        code = read_class_key(self._folder / "class.key").code
        found = []
        for robot in self.robots:
            address = robot["address"].rstrip("/")
            body = json.dumps({"token": code}).encode()
            headers = {"Content-Type": "application/json", "Origin": address}
            with urlopen(Request(f"{address}/api/pair", body, headers), timeout=30) as answer:
                cookie = answer.headers["Set-Cookie"].partition(";")[0]
            url = address.replace("http", "ws", 1) + "/ws/drive"
            headers = {"Cookie": cookie, "Origin": address}
            found.append(Pilot(url, sees=True, additional_headers=headers))
        return found

    def measure(self) -> dict[str, float]:
        """Return the figures of the robots and of the board."""
        below = [measure_process(pid, "Pss") for pid in descendants(self.process.pid)]
        # A robot has more threads than the process that they were forked from.
        robots = [one for one in below if one["threads"] > 3][: self._count]
        board = measure_process(self.process.pid, "Pss")
        count = max(len(robots), 1)
        return {
            "robots": len(robots),
            **{f"mean {name}": sum(one[name] for one in robots) / count for name in board},
            "most memory MB": max((one["memory MB"] for one in robots), default=0.0),
            **{f"board {name}": value for name, value in board.items()},
            "disk MB": disk_mb(self._folder),
        }

    def stop_all(self) -> float:
        """Press STOP for all; return the time until all stand, in seconds."""
        began_s = time.monotonic()
        self._ask("/api/stop", {"robot": None})
        wait_until(lambda: all(one["emergency"] for one in self._now()), "all are stopped", 30)
        return time.monotonic() - began_s

    def _now(self) -> list[dict[str, Any]]:
        return list(self._ask("/api/robots")["robots"])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        """End it by Ctrl-C."""
        began_s = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        self.process.wait(120)
        self.ended_s = time.monotonic() - began_s


def descendants(pid: int) -> list[int]:
    """Return the processes below a process."""
    found = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in map(int, (task / "children").read_text().split()):
                found += [child, *descendants(child)]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--port", type=int, default=23400)
    args = parser.parse_args()
    stops_s: list[float] = []
    with (
        tempfile.TemporaryDirectory() as name,
        Class(Path(name), args.robots, args.port) as held,
    ):
        pupils, growth = held.pupils(), Growth(EVERY_S, held.measure)
        stop_s = time.monotonic() + min(STOP_EVERY_S, args.minutes * 20)
        for _ in teach_and_hand_over(pupils, args.minutes):
            if time.monotonic() >= stop_s:
                stop_s += STOP_EVERY_S
                stops_s.append(held.stop_all())
                for pilot in pupils:
                    stopped = pilot.wait_for_state(emergency=True)
                    pilot.send(type="release", stop_number=stopped["stop_number"])
            growth.measure_if_due()
        lessons = sorted(pilot.state["lessons"] for pilot in pupils)
        for pilot in pupils:
            pilot.close()
    told = f"lessons {lessons[0]} to {lessons[-1]}"
    print(f"{args.robots} robots, {args.minutes:g} minutes, {told}")
    print(growth.table())
    print(f"started in {held.started_s:.1f} s, ended in {held.ended_s:.1f} s; ", end="")
    print(f"{len(stops_s)} times STOP: ", end="")
    print(f"all stood after at most {1000 * max(stops_s, default=0):.0f} ms, as the board shows it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
