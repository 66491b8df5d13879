"""The source of frames: a single slot with the newest frame, not a queue."""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Self

from robot.clock import Clock
from robot.driver import Driver
from robot.types import Encoding, Frame, StartStop


class Mounting:
    """How a camera is mounted: upright, unless an extension sets another `Mounting`."""

    def upright(self, picture: Frame) -> Frame:
        """Return the picture as if the camera stood upright."""
        return picture


class Camera(StartStop):
    """A source of frames, found by name among the entry points.

    Subclasses take pictures on a thread, or after each step of a simulated world. They pass each
    picture to `_publish`, which overwrites the slot and wakes the listener. Reading never blocks,
    so a frozen camera cannot hold up the loop. `start` and `stop` are idempotent. A camera declares
    its options as a driver does (`robot.driver.Driver`).

    Attributes:
        fault: A sentence for the page that says what is wrong with the camera, or None.
        source_age_s: For a camera on another computer: the age of a picture in seconds when it
            reaches that computer. The age does not include the time on the network. None if the
            camera belongs to this computer, or if the other computer reports no age.

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
    """True for a simulated world that stands still until the loop has acted on the newest picture.
    In such a world no picture is too old to drive by, even on a slow computer."""
    can_be_turned: ClassVar[bool] = True
    """False if `mounting` must not turn the pictures; those of a recording are already upright."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self._slot_lock = threading.Lock()
        self._latest: Frame | None = None
        self._last_frame_id = 0
        self.fault: str | None = None
        self.source_age_s: float | None = None
        self._on_frame: Callable[[], None] = lambda: None
        self.mounting = Mounting()
        """Turns all pictures upright, for the page, the recordings and the learner."""

    if TYPE_CHECKING:

        @property
        def device(self) -> str:
            """The device that a search found, such as `C270 (serial number A17)`, or empty."""
    else:
        device = ""  # not a property: a plugin may set an attribute of this name

    @classmethod
    @abstractmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        """Build a camera for use with `driver`; most cameras do not depend on the driver.

        Raises:
            ConfigurationError: If this camera cannot be used with `driver`.
        """

    @abstractmethod
    def start(self) -> None:
        """Begin to take pictures.

        Raises:
            CameraError: If the camera cannot be opened; the message names the camera and says what
                to do.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stop taking pictures and release the device."""

    def latest(self) -> Frame | None:
        """Return the newest frame, or None before the first. Never blocks."""
        return self._latest

    def world_s(self, at_s: float) -> float:
        """Convert `at_s`, a time of `self.clock`, to the time in the camera's world.

        Both times are equal unless `world_waits`: such a world stops its clock until the loop takes
        the next picture, so a pilot does not count as silent while the world waits.
        """
        return at_s

    def for_the_eye(self, frame: Frame) -> Frame:
        """Return a larger picture taken at the same moment as `frame`, or `frame` if there is none.

        The larger picture is only shown to people; `frame` is learned and recorded. Never blocks. A
        camera need not take larger pictures while nobody requests them.
        """
        return frame

    def rest(self, every_s: float) -> None:
        """Set the period at which pictures are needed until the next call, in seconds. Never
        blocks.

        With 0, all pictures are needed, and the next one immediately. With infinity, no picture is
        needed. A camera that renders pictures skips unneeded pictures; a camera that relays a
        device's pictures can ignore the period.
        """

    def listen(self, on_frame: Callable[[], None] | None) -> None:
        """Call `on_frame`, which must be quick, after each new frame, on the camera's thread."""
        self._on_frame = on_frame or (lambda: None)

    def _publish(
        self, data: bytes, *, width: int, height: int, encoding: Encoding, captured_s: float
    ) -> Frame:
        """Turn this picture upright, and make it the newest frame, with the next frame id. A
        `captured_s` in the future becomes the current time.
        """
        with self._slot_lock:
            self._last_frame_id += 1
            taken = Frame(
                frame_id=self._last_frame_id,
                captured_s=min(self.clock.now_s(), captured_s),
                width=int(width),  # a plugin may pass NumPy numbers
                height=int(height),
                encoding=Encoding(encoding),
                data=bytes(data),  # a copy, because a plugin may pass an array and reuse it
            )
            self._latest = frame = self.mounting.upright(taken)
            self.fault = None
        self._on_frame()
        return frame

    def _report_fault(self, sentence: str) -> None:
        """Set `fault`, and wake the listener if it is new; the next frame clears `fault`."""
        if (sentence := str(sentence)) != self.fault:  # a plugin may pass an error
            self.fault = sentence
            self._on_frame()
