"""A camera whose pictures come from elsewhere, and a thread that watches that they come."""

from __future__ import annotations

import importlib.util
import threading
from abc import abstractmethod
from collections.abc import Callable
from typing import Any, Self

from robot.camera import Camera
from robot.clock import Clock, Worker
from robot.devices.freshness import Freshness
from robot.driver import Driver
from robot.errors import MissingExtraError

_WATCH_EVERY_S = 0.05


class WatchedCamera(Camera):
    """What cameras share that read on threads, or are called by a library.

    A subclass calls `_watch_over` when it starts, asks `_freshness` of each picture, and says in
    `_name_fault` what is wrong when they stay away.
    """

    def __init__(self, options: Any, clock: Clock) -> None:
        super().__init__(clock)
        self.options = options
        self._freshness = Freshness(clock.now_s())
        self._ending = threading.Event()
        self._threads: list[Worker] = []

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        """Build the camera; it goes with every driver."""
        return cls(options, clock)

    @abstractmethod
    def _name_fault(self, wrong: str) -> str:
        """Return the sentence for what is wrong, as that it "gives no pictures"."""

    def _lose(self, sentence: str) -> None:
        """Report that pictures stay away, unless a fault is known."""
        if self._fault is None:
            self._report_fault(sentence)

    def _need(self, *libraries: str) -> None:
        """Raise MissingExtraError unless these libraries are installed."""
        if any(importlib.util.find_spec(library) is None for library in libraries):
            raise MissingExtraError(f"the camera {self.name!r}", "camera")

    def _watch_over(self, *reading: Callable[[], None]) -> None:
        """Begin to watch the time, beside threads that read."""
        self._ending.clear()
        self._freshness = Freshness(self.clock.now_s())
        self._threads = [
            self.clock.start_thread(work, f"{self.name}-camera") for work in (*reading, self._watch)
        ]

    def _join(self, timeout_s: float = 2.0) -> None:
        """End the threads; one that hangs is left behind."""
        self._ending.set()
        for thread in self._threads:
            thread.join(timeout=timeout_s)
        self._threads = []
        self._freshness = Freshness(self.clock.now_s())  # the next start repeats nothing

    def _watch(self) -> None:
        while not self.clock.wait(self._ending, _WATCH_EVERY_S):
            wrong = self._freshness.fault(self.clock.now_s())
            if wrong is not None:
                self._lose(self._name_fault(wrong))
