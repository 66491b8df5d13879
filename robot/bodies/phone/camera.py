"""A phone as the robot's camera: its browser sends pictures to `server/bodies/eye_routes.py`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from robot.devices.options import Options, option
from robot.devkit.pictures import Picture
from robot.devkit.threaded_camera import WatchedCamera
from robot.errors import need

GONE = "The phone that is the robot's eye has disconnected: open its page again."
NOBODY = "No phone is the robot's eye: on the phone, open the address that the terminal shows."


@dataclass(frozen=True, slots=True, kw_only=True)
class PhoneOptions(Options):
    """The size and rate of the pictures that the phone sends."""

    eye_width: int = option(320, "width of the phone's pictures", range=(40, 1920))
    eye_height: int = option(240, "height of the phone's pictures", range=(30, 1080))
    eye_rate: float = option(15.0, "pictures a second", range=(1.0, 60.0))


class PhoneCamera(WatchedCamera):
    """Receives pictures from a phone's page; the websocket's owner calls `offer` and `lose`."""

    name: ClassVar[str] = "phone"
    options_type: ClassVar[type[Any]] = PhoneOptions
    source: object | None = None
    """The object that owns the phone's websocket, which sets this attribute itself."""
    _captured_s = 0.0
    _reason: str | None = NOBODY

    def _begin(self) -> None:
        need("cv2", "the camera 'phone'", "camera")
        self._watch_over()

    def offer(self, picture: Picture, captured_s: float, *, covered: bool = False) -> None:
        """Receive a picture from the phone.

        Args:
            picture: The picture; the caller has checked its header.
            captured_s: The time of exposure on `clock`. The time is clamped to the range from the
                previous picture's time to the present.
            covered: True if the phone's camera sees only black.
        """
        now_s = self.clock.now_s()
        if not self._threads or not self._freshness.is_new(picture.data, now_s):
            return
        if covered:
            self.lose("The phone sees only black: is its camera covered?")
            return
        self._reason = None
        self._captured_s = min(now_s, max(captured_s, self._captured_s))
        self._show_picture(picture, self._captured_s)

    def lose(self, reason: str = GONE) -> None:
        self._reason = reason
        if self._threads:
            self._report_fault(reason)

    def _name_fault(self, wrong: str) -> str:
        return self._reason or f"The phone {wrong}: is its page visible, and its screen on?"
