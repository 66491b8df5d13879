"""A camera that takes a picture when a test requests one."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from robot.camera import Camera
from robot.clock import Clock
from robot.driver import Driver
from robot.types import Encoding


class StillCamera(Camera):
    """Every picture has another grey value."""

    name: ClassVar[str] = "still"
    options_type: ClassVar[type[Any]] = object

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        return cls(clock)

    def start(self) -> None:
        pass

    def stop(self) -> None:
        pass

    def take(self) -> None:
        grey = bytes([7 * self._last_frame_id % 256])
        self._publish(
            grey * (3 * 40 * 30),
            width=40,
            height=30,
            encoding=Encoding.RGB,
            captured_s=self.clock.now_s(),
        )
