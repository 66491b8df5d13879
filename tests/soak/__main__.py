"""Serves, teaches and hands over for some minutes, and reports growth: outside CI.

`python -m tests.soak --minutes 60`: a real server with the simulator; a pilot teaches for 20 s and
hands over for 10, again and again; viewers connect, watch, stall and vanish. The report has the
growth per hour with intervals, from the fifth minute on (or from a quarter of a shorter run), and
the time to read the journal at the end.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import sys
import tempfile
import threading
from pathlib import Path

from tests.server.live_robot import Pilot
from tests.soak.measured import Growth
from tests.soak.served import Served, teach_and_hand_over


def come_and_go(url: str, ending: threading.Event) -> None:
    """Viewers, one after the other: some leave, some vanish."""
    chance = random.Random(1)
    while not ending.wait(chance.uniform(0.2, 1.5)):
        with contextlib.suppress(Exception):
            viewer = Pilot(url, sees=chance.random() < 0.5)
            viewer.is_silent = True
            ending.wait(chance.uniform(0.2, 2.0))
            if chance.random() < 0.3:
                viewer.vanish()
            viewer.close()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=30.0, metavar="HZ", help="pictures a second")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        rate = ("--frame-rate-hz", str(args.rate))
        served, ending = Served(Path(name), *rate), threading.Event()
        viewers = threading.Thread(target=come_and_go, args=(served.drive, ending), daemon=True)
        viewers.start()
        with Pilot(served.drive, sees=True) as pilot:
            growth = Growth(5.0, lambda: served.measure() | {"pictures": pilot.picture or 0})
            for _ in teach_and_hand_over([pilot], args.minutes):
                growth.measure_if_due()
            pictures, lessons = pilot.picture, pilot.state["lessons"]
            ending.set()
        viewers.join(10)
        ended_s = served.stop()
        again = Served(Path(name), *rate)
        again.stop()
    print(f"{args.minutes:g} minutes, {pictures} pictures, {lessons} lessons")
    print(growth.table())
    cpu_ms = 1000 * growth.gain("CPU s") / max(growth.gain("pictures"), 1)
    print(f"CPU a picture {cpu_ms:.2f} ms; SIGTERM {ended_s:.1f} s; ", end="")
    print(f"started in {served.ready_s:.1f} s, at the end in {again.ready_s:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
