"""The server that the soaks use, in a separate process.

Run as a program, this is `drivelesson`. The server writes its number of Python objects into a file
of $SOAK_FOLDER when it gets SIGUSR1.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

from server.__main__ import main
from tests.kit.ports import free_port
from tests.kit.wait import wait_until
from tests.server.live_robot import Pilot
from tests.soak.measured import disk_mb, measure_process

ROOT = Path(__file__).parents[2]
MOVES = ("forward", "left", "forward", "right")


class Served:
    """A simulated robot's server, measured from outside."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder, port = folder, free_port()
        self.http, self.drive = f"http://127.0.0.1:{port}", f"ws://127.0.0.1:{port}/ws/drive"
        began_s = time.monotonic()
        words = ["serve", "--no-page", "--robot", "sim", "--port", str(port), *options]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.soak.served", *words, "--data", str(folder / "data")],
            cwd=ROOT,
            env={**os.environ, "SOAK_FOLDER": str(folder)},
            stdout=subprocess.DEVNULL,
            stderr=(folder / "log").open("ab"),
        )
        wait_until(self._answers, "the server answers", 300.0)
        self.ready_s = time.monotonic() - began_s

    def _answers(self) -> bool:
        with contextlib.suppress(OSError):
            urllib.request.urlopen(self.http, timeout=30).close()
            return True
        return False

    def measure(self) -> dict[str, float]:
        objects = self.folder / "objects"
        objects.unlink(missing_ok=True)
        self.process.send_signal(signal.SIGUSR1)
        wait_until(lambda: objects.exists() and objects.read_text(), "the objects are counted")
        disk = {"objects": float(objects.read_text()), "disk MB": disk_mb(self.folder / "data")}
        return measure_process(self.process.pid) | disk

    def stop(self) -> float:
        """End the server with SIGTERM; return the time that this takes, in seconds."""
        began_s = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(60)
        return time.monotonic() - began_s


def teach_and_hand_over(pilots: list[Pilot], minutes: float) -> Iterator[None]:
    """Repeatedly teach for 20 s and hand over for 10 s; yield once a second."""
    end_s, turn = time.monotonic() + minutes * 60, 0
    while time.monotonic() < end_s:
        wanted = "train" if turn % 30 < 20 else "autonomous"
        for number, pilot in enumerate(pilots):
            with contextlib.suppress(Exception):  # a robot may be stopped or slow
                if pilot.states and pilot.state["mode"] != wanted:
                    pilot.mode(wanted)
                move = MOVES[(turn // 2 + number) % len(MOVES)]
                pilot.hold(move if wanted == "train" else None)
                del pilot.messages[:-50]
        turn += 1
        time.sleep(1.0)
        yield


def _count_objects(signum: int, frame: object) -> None:
    gc.collect()
    Path(os.environ["SOAK_FOLDER"], "objects").write_text(str(len(gc.get_objects())))


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, _count_objects)
    sys.exit(main())
