"""Calls the body for the loop, one call at a time, and stops the body at the pilot's deadline.

A tick may be late because of a busy computer, a slow learner, or a picture that takes long to read.
So each order to the body has a deadline: the time at which the pilot counts as silent. A watchdog
thread stops the body at the deadline unless the loop has extended it. The watchdog never waits for
a tick, a picture or the network. If the watchdog fails, the body stops by its own time limit,
`robot.driver.ACTION_TIMEOUT_S`.
"""

from __future__ import annotations

import contextlib
import math
import threading
from typing import Any

from robot.clock import Clock, Worker
from robot.driver import Driver
from robot.errors import DriveError, PluginErrors, RobotError
from robot.types import StartStop


class GuardedBody(StartStop):
    """Calls a driver, and stops it at the deadline of the last order.

    Attributes:
        lock: Lock for calls of the driver, which only one thread at a time may use. A driver that
            hangs also holds up the watchdog; then only the body's own time limit stops the body.
        errors: Converts the driver's errors to DriveErrors.
    """

    def __init__(self, driver: Driver, clock: Clock) -> None:
        self._driver, self._clock = driver, clock
        self.lock = clock.lock()
        self.errors = PluginErrors("robot", driver.name, DriveError, self.stop_motors)
        self._due_s = self._wakes_s = math.inf
        self._sooner = threading.Event()
        self._thread: Worker | None = None

    def ask(self, name: str, *args: object, **options: object) -> Any:
        """Call a method of the driver. Raises DriveError."""
        try:
            with self.lock:
                return getattr(self._driver, name)(*args, **options)
        except (RobotError, KeyboardInterrupt):
            raise
        except BaseException as error:  # a plugin may raise anything, and libraries call exit()
            raise self.errors.converted(name, error) from error

    def stop_motors(self) -> None:
        """Stop the body. Never raises, because a body that cannot be reached stops by itself."""
        with self.lock, contextlib.suppress(BaseException):
            self._driver.stop()

    def order(self, until_s: float) -> bool:
        """Set the deadline of an order; return False if `until_s` has passed. The caller holds
        `lock` until the order is sent.

        An order that keeps the robot still has no deadline: its `until_s` is infinite.
        """
        is_on_time = self._clock.now_s() < until_s
        self._due_s = until_s if is_on_time else math.inf
        if self._due_s < self._wakes_s:
            self._sooner.set()
        return is_on_time

    def start(self) -> None:
        """Begin to watch the deadline; idempotent."""
        if self._thread is None:
            self._is_ending = False
            self._thread = self._clock.start_thread(self._run, "watchdog")

    def stop(self) -> None:
        """End the watchdog's thread without stopping the body."""
        self._is_ending = True
        self._sooner.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
            self._thread = None

    def _run(self) -> None:
        while not self._is_ending:
            with self.lock:
                if self._clock.now_s() >= self._due_s:
                    self._due_s = math.inf
                    self.stop_motors()
                self._wakes_s, left_s = self._due_s, self._due_s - self._clock.now_s()
            self._clock.wait(self._sooner, None if math.isinf(left_s) else max(left_s, 0.0))
            self._sooner.clear()
