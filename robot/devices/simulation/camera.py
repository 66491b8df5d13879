"""The simulated robot's camera; in real time its thread is also what moves the world on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from robot.camera import Camera
from robot.clock import Clock, Worker
from robot.devices.options import Options, option
from robot.devices.simulation.renderer import HEIGHT_PX, LARGE_HEIGHT_PX, LARGE_WIDTH_PX, WIDTH_PX
from robot.devices.simulation.simulation import Simulation
from robot.driver import Driver
from robot.errors import CameraError, ConfigurationError, RobotError
from robot.types import Encoding, Frame

_LONGEST_GAP_S = 0.25
"""After a longer pause of the whole machine the world goes on from where it stood."""

_ASKED_FRAMES = 30
"""For so many frames after somebody asked for one, pictures for the eye are made."""


@runtime_checkable
class SimulatedBody(Protocol):
    """A driver that moves a simulation."""

    simulation: Simulation

    def advance(self, dt_s: float) -> None:
        """Let time pass in the world."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class SimCameraOptions(Options):
    """What a person may choose."""

    frame_rate_hz: float = option(30.0, "simulated pictures a second", range=(1.0, 120.0))
    jpeg_quality: int = option(75, "of simulated pictures", range=(1, 100))


class SimCamera(Camera):
    """Renders what the simulated robot sees.

    In real time it gives JPEG, as a webcam does: encoded once for page, recording and learner.
    `capture`, which experiments call as fast as they can, gives the pixels themselves: what they
    measure does not depend on a codec. Without OpenCV both give pixels.

    While people look there is a picture of 320x240 beside each JPEG (`for_the_eye`).
    """

    name: ClassVar[str] = "sim"
    options_type: ClassVar[type[Any]] = SimCameraOptions

    def __init__(self, body: SimulatedBody, options: SimCameraOptions, clock: Clock) -> None:
        super().__init__(clock)
        self._body = body
        self._compress = make_compressor(options.jpeg_quality)
        self._period_s = 1.0 / options.frame_rate_hz
        self._ending = threading.Event()
        self._thread: Worker | None = None
        self._failure: RobotError | None = None
        self._asked_id = -_ASKED_FRAMES
        self._large: Frame | None = None

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        """Look out of a simulated body."""
        if not isinstance(driver, SimulatedBody):
            raise ConfigurationError(
                f"the camera 'sim' only works with a simulated robot, not with {driver.name!r}"
            )
        return cls(driver, options, clock)

    def start(self) -> None:
        """Begin to take pictures in real time; returns when the first is there."""
        if self._thread is not None:
            return
        self._ending.clear()
        self._failure = None
        first = threading.Event()
        self._thread = self.clock.start_thread(lambda: self._run(first), "sim-camera")
        self.clock.wait(first, 20.0)
        if self._failure is not None:
            self.stop()
            raise self._failure
        if self.latest() is None:
            raise CameraError("the simulated camera gives no picture")

    def stop(self) -> None:
        """End the thread."""
        if self._thread is not None:
            self._ending.set()
            self._thread.join(timeout=5.0)
            self._thread = None

    def capture(self) -> Frame:
        """Take one picture now, on this thread: for experiments, which use no `start`."""
        picture = self._body.simulation.render()
        return self._publish(
            picture.tobytes(),
            width=WIDTH_PX,
            height=HEIGHT_PX,
            encoding=Encoding.RGB,
            captured_s=self.clock.now_s(),
        )

    def for_the_eye(self, frame: Frame) -> Frame:
        """Return the frame at 320x240; the first that is asked for comes with the next frame."""
        self._asked_id = frame.frame_id
        large = self._large
        return large if large is not None and large.frame_id == frame.frame_id else frame

    def _capture_jpeg(self) -> Frame:
        """Take one picture as a webcam gives it."""
        if self._compress is None:
            return self.capture()
        captured_s = self.clock.now_s()
        jpeg = self._compress(self._body.simulation.render())
        if self._last_frame_id - self._asked_id < _ASKED_FRAMES:
            self._large = Frame(  # before the frame itself: who hears of that may ask for this
                frame_id=self._last_frame_id + 1,
                captured_s=captured_s,
                width=LARGE_WIDTH_PX,
                height=LARGE_HEIGHT_PX,
                encoding=Encoding.JPEG,
                data=self._compress(self._body.simulation.render_large()),
            )
        return self._publish(
            jpeg,
            width=WIDTH_PX,
            height=HEIGHT_PX,
            encoding=Encoding.JPEG,
            captured_s=captured_s,
        )

    def _run(self, first: threading.Event) -> None:
        try:
            self._capture_jpeg()
            first.set()
            self._run_in_real_time()
        except RobotError as error:
            self._failure = error
            self._report_fault(str(error))
            first.set()
        finally:
            self._body.simulation.close()

    def _run_in_real_time(self) -> None:
        last_s = self.clock.now_s()
        due_s = last_s + self._period_s
        while not self.clock.wait(self._ending, max(0.0, due_s - self.clock.now_s())):
            now_s = self.clock.now_s()
            self._body.advance(min(now_s - last_s, _LONGEST_GAP_S))
            last_s = now_s
            self._capture_jpeg()
            due_s = max(due_s + self._period_s, now_s)


def make_compressor(quality: int) -> Callable[[NDArray[np.uint8]], bytes] | None:
    """Return what makes a JPEG of pixels, shape (height, width, 3); None without OpenCV."""
    try:
        import cv2
    except ImportError:
        return None
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1]

    def compress(rgb: NDArray[np.uint8]) -> bytes:
        _, jpeg = cv2.imencode(".jpg", np.ascontiguousarray(rgb[:, :, ::-1]), options)
        return bytes(jpeg)

    return compress
