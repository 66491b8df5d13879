"""Where frames come from: one slot that always holds the newest, and never a queue."""

from __future__ import annotations

import threading
import time
from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Self

from robot.clock import Clock
from robot.corrections import Mounting, RawPicture
from robot.driver import Driver
from robot.errors import ConfigurationError, need
from robot.types import Encoding, Frame, StartStop


class Camera(StartStop):
    """A source of frames. Found by name among the entry points.

    Subclasses take pictures on a thread of their own (or when a world steps) and hand
    each to `_publish`, which overwrites the one slot and wakes the listener. Reading never
    blocks, so a frozen camera cannot hold up the loop. `start` and `stop` are idempotent.
    Options are declared as a driver declares its own.

    Attributes:
        fault: The camera's fault, as a sentence for the page; None if all is well.
        source_age_s: Age of the pictures at the computer that the camera is plugged into, as it
            reports it, in seconds; waiting and transit come on top. None: the camera is plugged
            in here, or does not report it.

    Example:
        >>> from robot.testing import VirtualClock
        >>> from robot.testing import FakeCamera
        >>> camera = FakeCamera(VirtualClock())
        >>> camera.latest() is None
        True
        >>> frame = camera.take()
        >>> camera.latest() is frame, frame.frame_id, len(frame.data)
        (True, 1, 57600)
    """

    name: ClassVar[str]
    options_type: ClassVar[type[Any]]
    world_waits: ClassVar[bool] = False
    """True if the world waits until the loop has acted on the newest picture: then a picture is
    never too old to drive by, however slow the computer is."""
    can_be_turned: ClassVar[bool] = True
    """False if its pictures are upright already: they were recorded."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self._slot_lock = threading.Lock()
        self._latest: Frame | None = None
        self._last_frame_id = 0
        self.fault: str | None = None
        self.source_age_s: float | None = None
        self._on_frame: Callable[[], None] = lambda: None
        self.mounting = Mounting()

    if TYPE_CHECKING:

        @property
        def device(self) -> str:
            """The device that a search found, as `C270 (serial number A17)`; else empty."""
    else:
        device = ""  # no property: a plug-in may have an attribute of this name

    @classmethod
    @abstractmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        """Build the camera that goes with `driver`; most cameras use nothing of the driver.

        Raises:
            ConfigurationError: If this camera cannot work beside that driver.
        """

    @abstractmethod
    def start(self) -> None:
        """Begin to take pictures.

        Raises:
            CameraError: If the camera cannot be opened; the message says which and what to do.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stop taking pictures and let go of the device."""

    def latest(self) -> Frame | None:
        """Return the newest frame, or None before the first. Never blocks."""
        return self._latest

    def world_s(self, at_s: float) -> float:
        """Return the time of the world's own clock when `self.clock` showed `at_s`.

        The two are the same unless `world_waits`. Then the world's clock stops while the world is
        computed or waits for the loop, so that this time does not count as the pilot's silence.
        """
        return at_s

    def for_the_eye(self, frame: Frame) -> Frame:
        """Return a larger picture of the moment of `frame` if this camera has one, else `frame`.

        Only people look at it; what is learned and recorded is `frame`. Never blocks. A camera
        may make such pictures only while they are asked for.
        """
        return frame

    def mount(self, mounting: Mounting) -> None:
        """Turn all further pictures upright: for page, recordings and learner alike.

        Raises:
            ConfigurationError: If this camera's pictures are not to be turned.
            MissingExtraError: If that needs OpenCV, and it is not installed.
        """
        if not mounting.is_upright:
            if not self.can_be_turned:
                raise ConfigurationError(f"pictures of the camera {self.name!r} are not turned")
            newest = self.latest()
            if newest is None or newest.encoding is Encoding.JPEG:
                need("cv2", "turning a camera's pictures", "camera")
        self.mounting = mounting

    def rest(self, every_s: float) -> None:
        """Set that one picture in `every_s` is enough, until the next call.

        0: all are needed, the next at once. Infinite: none is needed. Returns at once. A camera
        that renders its pictures skips the others; one that passes on a device's may ignore this.
        """

    def listen(self, on_frame: Callable[[], None] | None) -> None:
        """Have `on_frame` called after each new frame, on the camera's thread; it must be quick."""
        self._on_frame = on_frame or (lambda: None)

    def _on_clock(self, taken_s: float) -> float:
        """Return the time of `self.clock` when `time.monotonic()` was `taken_s`.

        The clock is read first: a thread that is held up between the two readings makes the
        picture older than it is, never younger.
        """
        clock_s = self.clock.now_s()
        return clock_s - max(0.0, time.monotonic() - taken_s)

    def _publish(
        self, data: bytes, *, width: int, height: int, encoding: Encoding, captured_s: float
    ) -> Frame:
        """Make these bytes the newest frame, with the next frame id; the future counts as now.

        The picture is as the camera took it; the frame is upright.
        """
        upright = self.mounting.upright(RawPicture(data, width, height, encoding))
        with self._slot_lock:
            self._last_frame_id += 1
            frame = Frame(
                frame_id=self._last_frame_id,
                captured_s=min(self.clock.now_s(), captured_s),
                width=upright.width,
                height=upright.height,
                encoding=upright.encoding,
                data=upright.data,
            )
            self._latest = frame
            self.fault = None
        self._on_frame()
        return frame

    def _report_fault(self, sentence: str) -> None:
        """Set the fault, and wake the listener if it is news; the next frame clears it."""
        if sentence != self.fault:
            self.fault = sentence
            self._on_frame()
