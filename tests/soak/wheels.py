"""`drivelesson`, which notes when the simulated wheels turn and stand, one line each.

A line contains the system's monotonic time in seconds, which other processes share, and the move.
"""

from __future__ import annotations

import os
import sys
import time
from typing import Any

from robot.simulator.driver import SimDriver
from server.__main__ import main

notes = os.open(os.environ["SOAK_WHEELS"], os.O_WRONLY | os.O_CREAT | os.O_APPEND)
told = "stop"


def note(driver: SimDriver) -> None:
    global told
    now = str(driver.simulation.action)
    if now != told:
        told = now
        os.write(notes, f"{time.monotonic():.4f} {now}\n".encode())


def noting(name: str) -> None:
    real = getattr(SimDriver, name)

    def call(driver: SimDriver, *args: Any) -> None:
        with driver._lock:
            real(driver, *args)
            note(driver)

    setattr(SimDriver, name, call)


noting("_drive")
noting("stop")
sys.exit(main())
