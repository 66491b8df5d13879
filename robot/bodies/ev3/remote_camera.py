"""The camera on a remote brick, through the agent that also moves its motors."""

from __future__ import annotations

import contextlib
from dataclasses import asdict
from typing import Any, ClassVar, Self

from robot.bodies.ev3.link import BrickLink, RemotePicture
from robot.bodies.v4l2.camera import UsbCameraOptions
from robot.clock import Clock
from robot.devkit.threaded_camera import WatchedCamera
from robot.driver import Driver
from robot.errors import CameraError, ConfigurationError, DriveError


class Ev3RemoteCamera(WatchedCamera):
    """Delivers the newest frames of the brick's camera, unchanged, with times of this machine's
    clock."""

    name: ClassVar[str] = "ev3-remote"
    options_type: ClassVar[type[Any]] = UsbCameraOptions

    def __init__(self, options: UsbCameraOptions, clock: Clock, link: BrickLink) -> None:
        super().__init__(options, clock)
        self._link = link

    @classmethod
    def for_driver(cls, driver: Driver, options: UsbCameraOptions, clock: Clock) -> Self:
        link = getattr(driver, "link", None)
        if not isinstance(link, BrickLink):
            raise ConfigurationError(
                "the camera 'ev3-remote' only works with the robot 'ev3-remote', not with "
                f"{driver.name!r}"
            )
        return cls(options, clock, link)

    def _begin(self) -> None:
        """Have the agent open its camera and send the pictures."""
        self._link.on_picture = self._take
        wanted = asdict(self.options)
        try:
            self._link.hold("camera", "video", rate=wanted.pop("frame_rate"), **wanted)
        except DriveError as error:
            raise CameraError(str(error)) from error
        self._watch_over()

    def _let_go(self) -> None:
        self._link.on_picture = None
        # without a connection the brick closes its camera by itself
        with contextlib.suppress(DriveError):
            self._link.send("blind")
        self._link.release("camera")

    def _take(self, picture: RemotePicture) -> None:
        age_s = self._link.report.get("picture_age_s")
        self.source_age_s = max(0.0, float(age_s)) if isinstance(age_s, int | float) else None
        self._freshness.is_new(picture.data, self.clock.now_s())
        # Read the clock first: a delay after this line makes the picture seem older, never younger.
        now_s = self.clock.now_s()
        self._show_picture(picture, now_s - max(0.0, self._link.clock.now_s() - picture.taken_s))

    def _name_fault(self, wrong: str) -> str:
        return (
            self._link.fault
            or self._link.report.get("camera_fault")
            or "The brick sends no pictures"
        )
