"""The camera of a Gymnasium environment: its thread is also what moves the environment on."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from robot.bodies.gymnasium.driver import GymnasiumDriver
from robot.camera import Camera
from robot.clock import Clock, Worker
from robot.devices.options import Options, option
from robot.devices.simulation.camera import make_compressor
from robot.driver import ACTION_TIMEOUT_S, Driver
from robot.errors import CameraError, ConfigurationError
from robot.types import Encoding

_PATIENCE_S = 60.0
"""For a first picture: some environments load for long."""
_JPEG_QUALITY = 90


@dataclass(frozen=True, slots=True, kw_only=True)
class GymnasiumCameraOptions(Options):
    """What a person may choose."""

    env_rate_hz: float = option(10.0, "pictures a second, at most", range=(1.0, 60.0))


class GymnasiumCamera(Camera):
    """Sees what the environment gives to see.

    The environment waits for the loop: it goes on only after the loop has acted on the picture
    before. A slow computer makes it slower, and misses nothing.
    """

    name: ClassVar[str] = "gymnasium"
    options_type: ClassVar[type[Any]] = GymnasiumCameraOptions
    world_waits: ClassVar[bool] = True

    def __init__(
        self, body: GymnasiumDriver, options: GymnasiumCameraOptions, clock: Clock
    ) -> None:
        super().__init__(clock)
        self._body = body
        self._period_s = 1.0 / options.env_rate_hz
        self._compress = make_compressor(_JPEG_QUALITY)
        self._ending = threading.Event()
        self._thread: Worker | None = None

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        """Look into the environment that `driver` acts in."""
        if not isinstance(driver, GymnasiumDriver):
            raise ConfigurationError(
                f"the camera 'gymnasium' works with the robot 'gymnasium', not {driver.name!r}"
            )
        return cls(driver, options, clock)

    def start(self) -> None:
        """Open the environment, and begin; returns when the first picture is there."""
        if self._thread is not None:
            return
        self._ending.clear()
        first = threading.Event()
        self._thread = self.clock.start_thread(lambda: self._run(first), "gymnasium-camera")
        self.clock.wait(first, _PATIENCE_S)
        if self.fault is not None or not first.is_set():
            fault = self.fault or "the environment gives no picture"
            self.stop()
            raise CameraError(fault)

    def stop(self) -> None:
        """End the thread, and close the environment."""
        if self._thread is not None:
            self._ending.set()
            self._body.acted.set()
            self._thread.join(timeout=5.0)
            self._thread = None

    def _run(self, first: threading.Event) -> None:
        try:
            self._capture()
            first.set()
            while not self.clock.wait(self._ending, self._period_s):
                self.clock.wait(self._body.acted, ACTION_TIMEOUT_S)
                self._body.advance(self._period_s)
                self._capture()
        except Exception as error:  # top of a thread that runs other people's code
            self._report_fault(f"the environment failed: {error}")
            first.set()
        finally:
            self._body.close()

    def _capture(self) -> None:
        pixels = self._body.picture()
        height, width = pixels.shape[:2]
        self._body.acted.clear()
        self._publish(
            pixels.tobytes() if self._compress is None else self._compress(pixels),
            width=width,
            height=height,
            encoding=Encoding.RGB if self._compress is None else Encoding.JPEG,
            captured_s=self.clock.now_s(),
        )
