"""A USB camera by the kernel's own interface: no OpenCV, and nothing decoded on the way."""

from __future__ import annotations

import select
import threading
import time
from typing import Any, ClassVar, Self

from robot.brick.agent import Eye
from robot.brick.camera_options import UsbCameraOptions
from robot.camera import Camera
from robot.clock import Clock
from robot.driver import Driver
from robot.errors import CameraError
from robot.types import Encoding


class V4l2Camera(Camera):
    """Frames as the camera sends them, stamped by its kernel driver."""

    name: ClassVar[str] = "v4l2"
    options_type: ClassVar[type[Any]] = UsbCameraOptions

    def __init__(self, options: UsbCameraOptions, clock: Clock) -> None:
        super().__init__(clock)
        self.options = options
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    @classmethod
    def for_driver(cls, driver: Driver, options: UsbCameraOptions, clock: Clock) -> Self:
        """Build the camera; it needs nothing of the driver."""
        return cls(options, clock)

    def start(self) -> None:
        """Open the camera and take pictures on a thread.

        Raises:
            CameraError: If it cannot be opened.
        """
        if self._thread is not None:
            return
        options = self.options
        eye = Eye(
            options.device, options.width, options.height, options.frame_rate, options.encoding
        )
        eye.look(time.monotonic())
        if eye.video is None:
            raise CameraError(eye.fault or "the camera cannot be opened")
        self._ending.clear()
        self._thread = threading.Thread(
            target=self._watch, args=(eye,), name="v4l2-camera", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End the thread and let go of the camera."""
        if self._thread is not None:
            self._ending.set()
            self._thread.join(timeout=2.0)
            self._thread = None

    def _watch(self, eye: Eye) -> None:
        try:
            while not self._ending.is_set():
                self._turn(eye)
        finally:
            eye.close()

    def _turn(self, eye: Eye) -> None:
        """Wait at most 50 ms for a picture; publish it, or say what is wrong."""
        if eye.video is None:
            self._ending.wait(0.05)
        else:
            select.select([eye.video], [], [], 0.05)
        taken = eye.look(time.monotonic())
        if taken is not None and eye.video is not None:
            self._publish(
                taken.data,
                width=eye.video.width,
                height=eye.video.height,
                encoding=Encoding(eye.video.encoding),
                captured_s=self._on_clock(taken.taken_s),
            )
        elif eye.fault is not None and eye.fault != self._fault:
            self._report_fault(eye.fault)
