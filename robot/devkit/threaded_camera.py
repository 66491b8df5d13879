"""Base classes of cameras with threads."""

from __future__ import annotations

import threading
import time
from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar, Self

from robot.camera import Camera
from robot.clock import Clock, Worker
from robot.devkit.freshness import Freshness
from robot.devkit.pictures import Picture
from robot.driver import Driver
from robot.errors import CameraError, PluginErrors, RobotError
from robot.types import Encoding, Frame

_WATCH_EVERY_S = 0.05
LARGEST_PX = 65_535
"""Maximum width and height of a picture, in pixels. Neither a JPEG nor the header of a picture's
message can hold a larger number."""


class ThreadedCamera(Camera):
    """A camera that runs threads. `_begin` starts the threads by calling `_work`, and `stop` ends
    them."""

    longest_join_s: ClassVar[float] = 2.0
    """Longest wait for a thread to end, in seconds. A thread that hangs is left running."""

    def __init__(self, options: Any, clock: Clock) -> None:
        super().__init__(clock)
        self.options = options
        self._ending = threading.Event()
        self._threads: list[Worker] = []

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        """Build the camera, which works with every driver."""
        return cls(options, clock)

    def start(self) -> None:
        if not self._threads:
            try:
                self._begin()
            except BaseException:
                self.stop()
                raise

    @abstractmethod
    def _begin(self) -> None:
        """Open the device and start the threads; an error stops the camera again."""

    def _let_go(self) -> None:
        """Close the device before the threads are joined; idempotent."""

    def stop(self) -> None:
        self._ending.set()
        self._let_go()
        for thread in self._threads:
            thread.join(timeout=self.longest_join_s)
        self._threads = []

    def _work(self, *works: Callable[[], None]) -> None:
        """Run each function on a thread. The function must return soon after `_ending` is set. If
        it raises an error, all threads end, and the error becomes the camera's fault."""
        self._ending.clear()
        self._threads = [
            self.clock.start_thread(partial(self._run_guarded, work), f"{self.name}-camera")
            for work in works
        ]

    def _run_guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except (Exception, SystemExit) as error:  # the camera may be a plugin and raise anything
            if self._ending.is_set():  # reading a device fails once `stop` has closed it
                return
            self._ending.set()  # otherwise the watchdog would replace the fault with its own
            if not isinstance(error, RobotError):
                named = PluginErrors("camera", self.name, CameraError)
                error = named.converted("its thread", error)
            self._report_fault(str(error))

    def _on_clock(self, taken_s: float) -> float:
        """Convert `taken_s`, a time of `time.monotonic()`, to the time of `self.clock`.

        `self.clock` is read first: if the thread is held up between the two readings, the picture
        seems older than it is, never younger.
        """
        clock_s = self.clock.now_s()
        return clock_s - max(0.0, time.monotonic() - taken_s)

    def _publish(
        self, data: bytes, *, width: int, height: int, encoding: Encoding, captured_s: float
    ) -> Frame:
        """Make this picture the newest frame, as `Camera` does. Raises CameraError if the picture
        is wider or higher than `LARGEST_PX`."""
        if max(width, height) > LARGEST_PX:
            raise CameraError(
                f"The camera {self.name} gives pictures of {width}x{height} pixels, but at most "
                f"{LARGEST_PX}x{LARGEST_PX} can be shown; choose a smaller size."
            )
        return super()._publish(
            data, width=width, height=height, encoding=encoding, captured_s=captured_s
        )

    def _show_picture(self, picture: Picture | Frame, captured_s: float) -> None:
        self._publish(
            picture.data,
            width=picture.width,
            height=picture.height,
            encoding=picture.encoding,
            captured_s=captured_s,
        )


class WatchedCamera(ThreadedCamera):
    """Base class of cameras that read pictures on their own threads, or get them from a library.

    In `_begin`, a subclass calls `_watch_over` to start its threads. It passes each picture to
    `_freshness.is_new`. Its method `_name_fault` returns the message about a fault.
    """

    def __init__(self, options: Any, clock: Clock) -> None:
        super().__init__(options, clock)
        self._freshness = Freshness(clock.now_s())

    @abstractmethod
    def _name_fault(self, wrong: str) -> str:
        """Return the sentence for a fault such as "gives no pictures"."""

    def _watch_over(self, *reading: Callable[[], None]) -> None:
        """Start the watchdog and the threads that read pictures."""
        self._freshness = Freshness(self.clock.now_s())
        self._work(*reading, self._watch)

    def _watch(self) -> None:
        while not self.clock.wait(self._ending, _WATCH_EVERY_S):
            wrong = self._freshness.fault(self.clock.now_s())
            if wrong is not None:
                # report the fault at each check, because its sentence may change
                self._report_fault(self._name_fault(wrong))
