"""The one thread that waits for the disk: it records, saves and flushes, one after the other."""

from __future__ import annotations

import threading
from collections.abc import Callable

from robot.clock import Clock, Worker
from robot.types import StartStop

FLUSH_EVERY_S = 0.2
"""A kill or a power cut loses at most so much, while the disk keeps up."""


class DiskThread(StartStop):
    """Takes its turns every `every_s`, one after the other, and once more at the end.

    A turn writes what waits for it and never raises.
    """

    def __init__(self, clock: Clock, every_s: float = FLUSH_EVERY_S) -> None:
        self._clock = clock
        self._every_s = every_s
        self._turns: list[Callable[[], None]] = []
        self._ending = threading.Event()
        self._thread: Worker | None = None

    def add(self, turn: Callable[[], None]) -> None:
        self._turns.append(turn)

    def start(self) -> None:
        if self._thread is None:
            self._ending.clear()
            self._thread = self._clock.start_thread(self._run, "disk")

    def stop(self) -> None:
        """Take the last turns, and end; gives up on a hanging disk after ten seconds."""
        thread, self._thread = self._thread, None
        if thread is not None:
            self._ending.set()
            thread.join(timeout=10.0)

    def _run(self) -> None:
        is_last = False
        while not is_last:
            is_last = self._clock.wait(self._ending, self._every_s)
            for turn in self._turns:
                turn()
