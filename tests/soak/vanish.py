"""Drives, vanishes, and measures when the wheels stand: outside CI.

`python -m tests.soak.vanish --drives 300 --load 4`: a real server with the simulator. In each drive
a pilot holds a move and then, at random, falls silent or is cut off. `--load 4` keeps every core
busy with four processes of equal priority. The report has the time from the pilot's last message
until no wheel turns, and the number of drives in which a wheel turned again: a busy computer may
stop the robot for a late picture and drive on with the next, while the pilot's last order is valid.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

from tests.kit.ports import free_port
from tests.server.live_robot import Pilot

ROOT = Path(__file__).parents[2]
WATCHED_S = 1.2
ASKED_S = 0.5


class TimedPilot(Pilot):
    """Knows when it sent its last message."""

    sent_s = 0.0

    def send(self, **message: object) -> None:
        self.sent_s = time.monotonic()
        super().send(**message)


class Wheels:
    """The motion of the simulated wheels."""

    def __init__(self, notes: Path) -> None:
        self._notes = notes

    def turns(self) -> list[tuple[float, bool]]:
        """Return the times at which they began to turn (True) or stood."""
        lines = self._notes.read_text().splitlines() if self._notes.exists() else []
        return [(float(at), move != "stop") for at, move in map(str.split, lines)]

    def are_turning(self) -> bool:
        turns = self.turns()
        return bool(turns) and turns[-1][1]


class Drives:
    """Makes drives one after the other; a pilot that was only silent drives again."""

    def __init__(self, url: str, wheels: Wheels, seed: int) -> None:
        self._url, self._wheels, self._dice = url, wheels, random.Random(seed)
        self._pilot: TimedPilot | None = None

    def drive(self) -> list[tuple[float, bool]] | None:
        """Drive, vanish, and return the wheels' motion since the pilot's last message.

        None if they stood when the pilot vanished, because a busy machine had stopped the robot
        before.
        """
        dice, wheels = self._dice, self._wheels
        pilot = self._pilot = self._pilot or TimedPilot(self._url)
        pilot.is_silent = False
        pilot.drive_until(wheels.are_turning, mode=dice.choice(["train", "autonomous"]))
        time.sleep(dice.uniform(0.1, 0.4))
        with pilot._lock:
            pilot.is_silent = True
        was_turning = wheels.are_turning()
        gone_s = pilot.sent_s
        if dice.random() < 0.5:
            pilot.vanish()
            gone_s, self._pilot = time.monotonic(), None
        time.sleep(WATCHED_S)
        if self._pilot is None:
            pilot.close()
        after = [(at_s - gone_s, turn) for at_s, turn in wheels.turns() if at_s > gone_s]
        return after if was_turning and after else None


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=300)
    parser.add_argument("--load", type=int, default=0, help="busy processes for each core")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    took_s: list[float] = []
    again = again_late = skipped = 0
    with tempfile.TemporaryDirectory() as name:
        folder, port = Path(name), free_port()
        words = ["-m", "tests.soak.wheels", "serve", "--no-page", "--robot", "sim"]
        server = subprocess.Popen(
            [sys.executable, *words, "--port", str(port), "--data", str(folder / "data")],
            cwd=ROOT,
            env={**os.environ, "SOAK_WHEELS": str(folder / "wheels")},
            stdout=subprocess.DEVNULL,
            stderr=(folder / "log").open("ab"),
        )
        busy = [
            subprocess.Popen([sys.executable, "-c", "while True: pass"])
            for _ in range(args.load * (os.cpu_count() or 1))
        ]
        try:
            while True:
                try:
                    urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=30).close()
                    break
                except OSError:
                    time.sleep(0.2)
            url = f"ws://127.0.0.1:{port}/ws/drive"
            drives = Drives(url, Wheels(folder / "wheels"), args.seed)
            while len(took_s) < args.drives:
                after = drives.drive()
                if after is None:
                    skipped += 1
                    continue
                took_s.append(after[-1][0])
                if any(turn for _, turn in after):
                    again += 1
                    again_late += any(turn and at_s > ASKED_S for at_s, turn in after)
                    print("turned again:", [(round(at_s, 3), turn) for at_s, turn in after])
        finally:
            for process in [*busy, server]:
                process.kill()
                process.wait()
    took_s.sort()
    late = sum(one > ASKED_S for one in took_s)
    print(f"{len(took_s)} drives, load {args.load} (machine: {os.getloadavg()[0]:.1f})", end="; ")
    print(f"{skipped} more in which the robot stood before the pilot vanished")
    print(f"it stands after {1000 * took_s[len(took_s) // 2]:.0f} ms (median), ", end="")
    print(f"{1000 * took_s[-1]:.0f} ms (worst); after 500 ms {late}; ", end="")
    print(f"turned again {again}, of these after 500 ms {again_late}")
    return 0


sys.exit(main())
