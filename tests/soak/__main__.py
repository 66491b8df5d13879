"""Serves a robot that is taught and drives for some minutes, and reports growth; not part of CI.

`python -m tests.soak --minutes 60` runs a real server with the simulator. A pilot repeatedly
teaches for 20 s and hands over for 10 s, while viewers connect, watch, stall and vanish. The report
has the growth per hour with intervals, from the fifth minute on (in a shorter run, after a
quarter), and the time to read the journal at the end.

`--robots 10` does the same with `drivelesson class`, with a pupil at each robot and a teacher who
stops all robots every five minutes. The report has the growth of the robots and of the board, and
the longest time until all robots stood.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import sys
import tempfile
import threading
import time
from pathlib import Path

from tests.server.live_robot import Pilot
from tests.soak.classroom import Class
from tests.soak.measured import Growth
from tests.soak.served import Served, teach_and_hand_over

STOP_EVERY_S = 300.0


def come_and_go(url: str, ending: threading.Event) -> None:
    """Open viewers one after the other; some leave, and some vanish without closing."""
    chance = random.Random(1)
    while not ending.wait(chance.uniform(0.2, 1.5)):
        with contextlib.suppress(Exception):
            viewer = Pilot(url, sees=chance.random() < 0.5)
            viewer.is_silent = True
            ending.wait(chance.uniform(0.2, 2.0))
            if chance.random() < 0.3:
                viewer.vanish()
            viewer.close()


def one_robot(folder: Path, minutes: float, rate_hz: float) -> None:
    rate = ("--frame-rate-hz", str(rate_hz))
    served, ending = Served(folder, *rate), threading.Event()
    viewers = threading.Thread(target=come_and_go, args=(served.drive, ending), daemon=True)
    viewers.start()
    with Pilot(served.drive, sees=True) as pilot:
        growth = Growth(5.0, lambda: served.measure() | {"pictures": pilot.picture or 0})
        for _ in teach_and_hand_over([pilot], minutes):
            growth.measure_if_due()
        pictures, lessons = pilot.picture, pilot.state["lessons"]
        ending.set()
    viewers.join(10)
    ended_s = served.stop()
    again = Served(folder, *rate)
    again.stop()
    print(f"{minutes:g} minutes, {pictures} pictures, {lessons} lessons")
    print(growth.table())
    cpu_ms = 1000 * growth.gain("CPU s") / max(growth.gain("pictures"), 1)
    print(f"CPU per picture {cpu_ms:.2f} ms; end {ended_s:.1f} s after SIGTERM; ", end="")
    print(f"start {served.ready_s:.1f} s, with the final data {again.ready_s:.1f} s")


def many_robots(folder: Path, minutes: float, robots: int) -> None:
    stops_s: list[float] = []
    with Class(folder, robots) as held:
        pupils, growth = held.pupils(), Growth(10.0, held.measure)
        stop_s = time.monotonic() + min(STOP_EVERY_S, minutes * 20)
        for _ in teach_and_hand_over(pupils, minutes):
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
    print(f"{robots} robots, {minutes:g} minutes, lessons {lessons[0]} to {lessons[-1]}")
    print(growth.table())
    print(f"started in {held.started_s:.1f} s, ended in {held.ended_s:.1f} s; ", end="")
    most_ms = 1000 * max(stops_s, default=0)
    print(f"{len(stops_s)} STOPs: by the board, all robots stood after at most {most_ms:.0f} ms")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=30.0, metavar="HZ", help="pictures a second")
    parser.add_argument("--robots", type=int, help="robots in a class; without it, one robot")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if args.robots:
            many_robots(Path(name), args.minutes, args.robots)
        else:
            one_robot(Path(name), args.minutes, args.rate)
    return 0


if __name__ == "__main__":
    sys.exit(main())
