"""The control loop in real time."""

from __future__ import annotations

import threading

from robot.clock import Clock, Worker
from robot.control.loop import ControlLoop
from robot.types import StopReason


class LoopThread:
    """Runs a `ControlLoop` on a thread of its own: a tick for each new frame, command or request,
    and every 50 ms or sooner without them."""

    def __init__(self, loop: ControlLoop, clock: Clock) -> None:
        self._loop = loop
        self._clock = clock
        self._ending = threading.Event()
        self._thread: Worker | None = None

    def start(self) -> None:
        """Start the loop; idempotent."""
        if self._thread is None:
            self._thread = self._clock.start_thread(self._run, "control-loop")

    def stop(self) -> None:
        """Stop the robot and end the thread; idempotent."""
        if self._thread is not None:
            self._loop.trip(StopReason.PILOT_GONE)
            self._ending.set()
            self._loop.wake.set()
            self._thread.join(timeout=5.0)
            self._thread = None

    def _run(self) -> None:
        loop = self._loop
        while not self._ending.is_set():
            self._clock.wait(loop.wake, loop.wait_s)
            loop.wake.clear()
            loop.tick(self._clock.now_s())
        loop.tick(self._clock.now_s())
