"""The camera of a Gymnasium environment; its thread also steps the environment."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.gymnasium.driver import GymnasiumDriver
from robot.clock import Clock
from robot.devices.encoders import jpeg_encoder
from robot.devices.options import Options, option
from robot.devkit.world_camera import WorldCamera
from robot.driver import ACTION_TIMEOUT_S
from robot.types import Encoding, Frame

_JPEG_QUALITY = 90
_REMEMBERED_FRAMES = 128
"""Number of pictures whose times are kept for `world_s`: twice as many as the control loop
keeps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GymnasiumCameraOptions(Options):
    """The options of the camera."""

    env_rate_hz: float = option(10.0, "maximum number of pictures a second", range=(1.0, 60.0))


class GymnasiumCamera(WorldCamera[GymnasiumDriver]):
    """Takes pictures of the environment.

    The environment waits for the loop: the next step comes only after the loop has acted on the
    previous picture. On a slow computer the environment runs slower, but the loop misses no
    picture. After each picture, the environment's time (`world_s`) advances with real time for at
    most one period, and then stops until the next picture.
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
        self._shown_s: deque[tuple[float, float]] = deque(maxlen=_REMEMBERED_FRAMES)
        """The time at which each picture was shown, with the world's time at that moment."""

    def world_s(self, at_s: float) -> float:
        shown = tuple(self._shown_s)
        if not shown:
            return at_s
        since_s, world_s = next((one for one in reversed(shown) if one[0] <= at_s), shown[0])
        return world_s + min(at_s - since_s, self._period_s)

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
        jpeg = self._compress(pixels)
        self._body.acted.clear()
        now_s = self.clock.now_s()
        self._shown_s.append((now_s, self.world_s(now_s)))
        return self._publish(
            jpeg, width=width, height=height, encoding=Encoding.JPEG, captured_s=now_s
        )
