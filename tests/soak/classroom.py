"""Runs a class in separate processes, and measures them from outside: `drivelesson class` with
simulated robots."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Self

import httpx

from server.board.class_key import read_class_key
from tests.kit.ports import free_ports
from tests.kit.wait import wait_until
from tests.server.live_robot import Pilot
from tests.soak.measured import disk_mb, measure_process
from tests.soak.served import ROOT

STARTED_S = 300.0


class Class:
    """A running class: its robots' processes, and its board.

    Attributes:
        board: The board's address.
        port: The board's port; the robots have the next ones.
        robots: The board's data about each robot, once all robots were there.
    """

    def __init__(self, folder: Path, robots: int) -> None:
        self.port = free_ports(robots + 1)
        self.board, self._folder, self._count = f"http://127.0.0.1:{self.port}", folder, robots
        began_s = time.monotonic()
        self.ended_s = 0.0
        words = ["class", "--robots", str(robots), "--host", "127.0.0.1", "--port", str(self.port)]
        with (folder / "log").open("ab") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "server", *words, "--data", str(folder)],
                cwd=ROOT,
                stdout=subprocess.DEVNULL,
                stderr=log,
            )
        wait_until(self._are_there, "all robots are there", STARTED_S)
        self.started_s = time.monotonic() - began_s
        self.robots = self.now()

    def _are_there(self) -> bool:
        if self.process.poll() is not None:
            raise SystemExit((self._folder / "log").read_text())
        with contextlib.suppress(httpx.TransportError):
            return [robot["status"] for robot in self.now()] == ["there"] * self._count
        return False

    def now(self) -> list[dict[str, Any]]:
        """Return the board's data about each robot."""
        return list(httpx.get(f"{self.board}/api/robots", timeout=30).json()["robots"])

    def pupils(self) -> list[Pilot]:
        """Pair a pilot with each robot, by the code on paper."""
        code = read_class_key(self._folder / "class.key").code
        found = []
        for robot in self.robots:
            origin = robot["page"].rstrip("/")
            asked = {"json": {"token": code}, "headers": {"Origin": origin}, "timeout": 30}
            answer = httpx.post(f"{origin}/api/pair", **asked).raise_for_status()
            cookie = {"Cookie": answer.headers["Set-Cookie"].partition(";")[0]}
            url = origin.replace("http", "ws", 1) + "/ws/drive"
            found.append(Pilot(url, sees=True, additional_headers=cookie, origin=origin))
        return found

    def measure(self) -> dict[str, float]:
        """Return the figures of the robots and of the board."""
        below = [measure_process(pid, "Pss") for pid in descendants(self.process.pid)]
        # The process from which robots are forked has fewer threads than a robot.
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
        httpx.post(f"{self.board}/api/stop", json={"robot": None}, timeout=30)
        wait_until(lambda: all(one["emergency"] for one in self.now()), "all robots stopped", 30)
        return time.monotonic() - began_s

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        """End the class by Ctrl-C."""
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
