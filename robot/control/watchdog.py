"""The dead man's switch on a separate thread: the body stops on time even if the loop is late.

A tick may be late because of a busy computer, a slow learner, or a picture that takes long to read.
So each order to the body has a deadline: the time at which the pilot counts as silent. Unless the
loop moves the deadline, this thread stops the body then. It never waits for a tick, a picture or
the network. If it fails, the body stops by its own time limit, `robot.driver.ACTION_TIMEOUT_S`.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

from robot.clock import Clock, Worker
from robot.types import StartStop


class Watchdog(StartStop):
    """Lets an order pass before its deadline, and stops the body at the deadline.

    Args:
        stop: Stops the body; must not raise.

    Attributes:
        body: Lock for calls of the driver, which only one thread at a time may use. A driver that
            hangs also holds up this thread; then only the body's own time limit helps.
    """

    def __init__(self, stop: Callable[[], None], clock: Clock) -> None:
        self._stop, self._clock = stop, clock
        self.body = clock.lock()
        self._due_s = self._wakes_s = math.inf
        self._sooner = threading.Event()
        self._is_ending = False
        self._thread: Worker | None = None

    def order(self, until_s: float) -> bool:
        """Set the deadline of an order. The caller holds the lock `body` until the order is sent.
        Return False if `until_s` has passed.

        An order that keeps the robot still has no deadline: its `until_s` is infinite.
        """
        is_on_time = self._clock.now_s() < until_s
        self._due_s = until_s if is_on_time else math.inf
        if self._due_s < self._wakes_s:
            self._sooner.set()
        return is_on_time

    def start(self) -> None:
        """Begin; idempotent."""
        if self._thread is None:
            self._is_ending = False
            self._thread = self._clock.start_thread(self._run, "watchdog")

    def stop(self) -> None:
        """End the thread without stopping the body."""
        self._is_ending = True
        self._sooner.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
            self._thread = None

    def _run(self) -> None:
        while not self._is_ending:
            with self.body:
                if self._clock.now_s() >= self._due_s:
                    self._due_s = math.inf
                    self._stop()
                self._wakes_s, left_s = self._due_s, self._due_s - self._clock.now_s()
            self._clock.wait(self._sooner, None if math.isinf(left_s) else max(left_s, 0.0))
            self._sooner.clear()
