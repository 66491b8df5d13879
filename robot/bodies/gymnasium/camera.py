"""The camera of a Gymnasium environment: its thread is also what moves the environment on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.gymnasium.driver import GymnasiumDriver
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devices.simulation.camera import WorldCamera
from robot.driver import ACTION_TIMEOUT_S
from robot.policy.image import jpeg_encoder
from robot.types import Encoding, Frame

_JPEG_QUALITY = 90


@dataclass(frozen=True, slots=True, kw_only=True)
class GymnasiumCameraOptions(Options):
    """What a person may choose."""

    env_rate_hz: float = option(10.0, "pictures a second, at most", range=(1.0, 60.0))


class GymnasiumCamera(WorldCamera[GymnasiumDriver]):
    """Sees what the environment gives to see.

    The environment waits for the loop: it goes on only after the loop has acted on the picture
    before. A slow computer makes it slower, and misses nothing.
    """

    name: ClassVar[str] = "gymnasium"
    options_type: ClassVar[type[Any]] = GymnasiumCameraOptions
    body_type = GymnasiumDriver
    world_waits: ClassVar[bool] = True
    patience_s: ClassVar[float] = 60.0

    def __init__(
        self, body: GymnasiumDriver, options: GymnasiumCameraOptions, clock: Clock
    ) -> None:
        super().__init__(body, options, clock)
        self._period_s = 1.0 / options.env_rate_hz
        self._compress = jpeg_encoder(_JPEG_QUALITY, "the camera of a simulated world")

    def _let_go(self) -> None:
        self._body.acted.set()

    def _live(self) -> None:
        while not self.clock.wait(self._ending, self._period_s):
            self.clock.wait(self._body.acted, ACTION_TIMEOUT_S)
            self._body.advance(self._period_s)
            self._take()

    def _leave(self) -> None:
        self._body.close()

    def _take(self) -> Frame:
        pixels = self._body.picture()
        height, width = pixels.shape[:2]
        self._body.acted.clear()
        return self._publish(
            self._compress(pixels),
            width=width,
            height=height,
            encoding=Encoding.JPEG,
            captured_s=self.clock.now_s(),
        )
