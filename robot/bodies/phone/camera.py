"""A phone as the robot's eye: its browser sends pictures to `server/bodies/eye_routes.py`."""

from __future__ import annotations

import importlib.util
import threading
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

from robot.camera import Camera
from robot.clock import Clock, Worker
from robot.devices.freshness import Freshness
from robot.driver import Driver
from robot.errors import MissingExtraError
from robot.types import Encoding

NOBODY = "No phone is the robot's eye: open the address that the terminal shows on the phone."
_WATCH_EVERY_S = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class PhoneOptions:
    """What the phone is asked for."""

    eye_width: int = field(
        default=320, metadata={"help": "width of the phone's pictures", "range": (40, 1920)}
    )
    eye_height: int = field(
        default=240, metadata={"help": "height of the phone's pictures", "range": (30, 1080)}
    )
    eye_rate: float = field(
        default=15.0, metadata={"help": "pictures a second", "range": (1.0, 60.0)}
    )


class PhoneCamera(Camera):
    """Receives pictures from a phone's page; the socket's owner calls `offer` and `lose`."""

    name: ClassVar[str] = "phone"
    options_type: ClassVar[type[Any]] = PhoneOptions

    def __init__(self, options: PhoneOptions, clock: Clock) -> None:
        super().__init__(clock)
        self.options = options
        self.source: object | None = None
        """Whoever holds the phone's socket now; it sets this itself."""
        self._freshness = Freshness(clock.now_s())
        self._captured_s = 0.0
        self._reason: str | None = NOBODY
        self._is_running = False
        self._ending = threading.Event()
        self._thread: Worker | None = None

    @classmethod
    def for_driver(cls, driver: Driver, options: PhoneOptions, clock: Clock) -> Self:
        """Build the camera; it goes with every driver."""
        return cls(options, clock)

    def start(self) -> None:
        """Begin to take pictures, and to watch that they go on coming.

        Raises:
            MissingExtraError: If the libraries that read JPEG are not installed.
        """
        for library in ("cv2", "imagesize"):
            if importlib.util.find_spec(library) is None:
                raise MissingExtraError("the camera 'phone'", "camera")
        if self._thread is None:
            self._ending.clear()
            self._is_running = True
            self._freshness = Freshness(self.clock.now_s())
            self._thread = self.clock.start_thread(self._watch, "phone-camera")

    def stop(self) -> None:
        """Stop receiving pictures."""
        self._is_running = False
        self._ending.set()
        if self._thread is not None:
            self._thread.join(timeout=2.0)
            self._thread = None

    def offer(
        self, jpeg: bytes, *, width: int, height: int, captured_s: float, covered: bool = False
    ) -> None:
        """Receive a picture from the phone.

        Args:
            jpeg: Its bytes; the caller has checked their header.
            width: In pixels.
            height: In pixels.
            captured_s: When it was taken, on `clock`. The future counts as now, and a picture is
                never older than the one before it.
            covered: The phone sees nothing but black.
        """
        now_s = self.clock.now_s()
        if not self._is_running or not self._freshness.is_new(jpeg, now_s):
            return
        if covered:
            self._lose("The phone sees only black: is its camera covered?")
            return
        self._reason = None
        self._captured_s = min(now_s, max(captured_s, self._captured_s))
        self._publish(
            jpeg,
            width=width,
            height=height,
            encoding=Encoding.JPEG,
            captured_s=self._captured_s,
        )

    def lose(self) -> None:
        """Report that the phone has disconnected."""
        self._lose("The phone that is the robot's eye is gone: open its page again.")

    def _lose(self, reason: str) -> None:
        self._reason = reason
        if self._is_running and self._fault != reason:
            self._report_fault(reason)

    def _watch(self) -> None:
        while not self.clock.wait(self._ending, _WATCH_EVERY_S):
            wrong = self._freshness.fault(self.clock.now_s())
            if wrong is not None:
                self._lose(self._reason or f"The phone {wrong}: is its page in front and awake?")
