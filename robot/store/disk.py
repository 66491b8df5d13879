"""A thread that writes to the disk, one job after the other."""

from __future__ import annotations

import threading
from collections.abc import Callable

from robot.clock import Clock, Worker
from robot.types import StartStop

Announce = Callable[..., None]
"""Called for each event that concerns the disk or a file, with the event's name and fields."""
FLUSH_EVERY_S = 0.2
"""Period of writing, in seconds. A crash or a power cut loses the data of at most this time, or
more on a slow disk."""


def no_announcement(name: str, **fields: object) -> None:
    """Ignore all events."""


class DiskThread(StartStop):
    """Runs the added jobs every `every_s`, and also when it is woken and at the end.

    A job is a function that writes a queue and never raises.
    """

    def __init__(
        self, clock: Clock, name: str = "disk", every_s: float | None = FLUSH_EVERY_S
    ) -> None:
        self._clock = clock
        self._name = name
        self._every_s = every_s
        self._jobs: list[Callable[[], None]] = []
        self._wake = threading.Event()
        self.wake = self._wake.set
        self._is_ending = False
        self._thread: Worker | None = None

    def add(self, job: Callable[[], None]) -> None:
        self._jobs.append(job)

    def start(self) -> None:
        if self._thread is None:
            self._is_ending = False
            self._thread = self._clock.start_thread(self._run, self._name)

    def stop(self) -> None:
        """Run the jobs once more, and end. If the disk hangs, wait for at most ten seconds."""
        thread, self._thread = self._thread, None
        if thread is not None:
            self._is_ending = True
            self._wake.set()
            thread.join(timeout=10.0)

    def _run(self) -> None:
        is_last = False
        while not is_last:
            self._clock.wait(self._wake, self._every_s)
            self._wake.clear()
            is_last = self._is_ending
            for job in self._jobs:
                job()
