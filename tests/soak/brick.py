"""Teach an emulated brick some thousand pictures, and report its memory: outside CI.

`python -m tests.soak.brick --pictures 5000`: a real server on an emulated EV3 (see `make
test-brick` for what it needs), taught two moves in turn. Every 250 lessons it prints the guest's
resident memory. It fails beyond the brick's limit, or if the second half grows by more than .1 MB.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

from _pytest.outcomes import Skipped

from tests.robot.bodies.ev3.armel import guest_memory_mb
from tests.robot.bodies.ev3.test_server_on_brick import MOST_MEMORY_MB, serve_on_brick

_EVERY = 250
_MOST_GROWTH_MB = 0.1
_STALLED_S = 120.0
"""Longest time without a lesson, in seconds."""


def soak(pictures: int) -> bool:
    """Teach this number of pictures; return whether memory stayed within its bounds."""
    measured: list[tuple[int, float]] = []
    with serve_on_brick() as served, served.pilot() as pilot:
        pilot.wait_for_state(120, you_are_pilot=True)
        taught, began_s = 0, time.monotonic()
        lesson_s = began_s
        while taught < pictures:
            pilot.held = "left" if taught // 100 % 2 else "forward"
            if pilot.state["mode"] != "train":
                pilot.mode("train")  # a stall of the emulator stops the robot, as it must
            time.sleep(0.2)
            del pilot.messages[:-50]
            now, now_s = sum(pilot.state["taught"].values()), time.monotonic()
            if now > taught:
                lesson_s = now_s
            if now_s - lesson_s > _STALLED_S:
                print(f"no lesson for {_STALLED_S:.0f} s: {pilot.state}")
                return False
            if now // _EVERY > taught // _EVERY:
                memory_mb = guest_memory_mb(served.process.pid)
                measured.append((now, memory_mb))
                print(f"{now} taught, {now_s - began_s:.0f} s: {memory_mb:.2f} MB", flush=True)
            taught = now
        pilot.mode("stopped")
        most_mb = MOST_MEMORY_MB[served.armel.release]
    later = [memory_mb for taught, memory_mb in measured if taught >= pictures / 2]
    growth_mb = max(later) - later[0]
    print(f"at most {max(mb for _, mb in measured):.2f} MB of {most_mb:g}; ", end="")
    print(f"second half {growth_mb:+.2f} MB")
    return max(mb for _, mb in measured) <= most_mb and growth_mb <= _MOST_GROWTH_MB


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=int, default=5000, help="lessons to teach")
    args = parser.parse_args()
    os.environ["DRIVELESSON_BRICK"] = "1"
    try:
        return 0 if soak(args.pictures) else 1
    except Skipped as error:
        print(error)
        return 2


if __name__ == "__main__":
    sys.exit(main())
