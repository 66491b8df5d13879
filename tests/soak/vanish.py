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
from pathlib import Path

from tests.server.live_robot import Pilot
from tests.soak.served import Served

WATCHED_S = 1.2
ASKED_S = 0.5


class TimedPilot(Pilot):
    """A pilot that remembers when it sent its last message."""

    sent_s = 0.0

    def send(self, **message: object) -> None:
        self.sent_s = time.monotonic()
        super().send(**message)


class Drives:
    """Makes drives one after the other; a pilot that was only silent drives again."""

    def __init__(self, served: Served, seed: int) -> None:
        self._served, self._dice = served, random.Random(seed)
        self._pilot: TimedPilot | None = None

    def _is_turning(self) -> bool:
        turns = self._served.turns()
        return bool(turns) and turns[-1][1]

    def drive(self) -> list[tuple[float, bool]] | None:
        """Drive, vanish, and return the wheels' motion since the pilot's last message.

        None if they stood when the pilot vanished, because a busy machine had stopped the robot
        before.
        """
        dice = self._dice
        pilot = self._pilot = self._pilot or TimedPilot(self._served.drive)
        pilot.is_silent = False
        pilot.drive_until(self._is_turning, mode=dice.choice(["train", "autonomous"]))
        time.sleep(dice.uniform(0.1, 0.4))
        with pilot._lock:
            pilot.is_silent = True
        was_turning, gone_s = self._is_turning(), pilot.sent_s
        if dice.random() < 0.5:
            pilot.vanish()
            gone_s, self._pilot = time.monotonic(), None
        time.sleep(WATCHED_S)
        if self._pilot is None:
            pilot.close()
        after = [(at_s - gone_s, turn) for at_s, turn in self._served.turns() if at_s > gone_s]
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
        endless, n_busy = [sys.executable, "-c", "while True: pass"], os.cpu_count() or 1
        busy = [subprocess.Popen(endless) for _ in range(args.load * n_busy)]
        try:
            served = Served(Path(name))
            busy.append(served.process)
            drives = Drives(served, args.seed)
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
            for process in busy:
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
