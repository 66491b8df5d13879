"""Reads a USB camera by the kernel's interface, without OpenCV and without decoding."""

from __future__ import annotations

import importlib.util
import select
import time
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.v4l2.reader import CameraReader
from robot.devices.options import Options, option
from robot.devkit.threaded_camera import ThreadedCamera
from robot.errors import CameraError
from robot.types import Encoding


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbCameraOptions(Options):
    """Options that choose a camera and the size of its pictures. The camera uses the nearest size
    that it supports."""

    device: str = option(
        "auto", "the camera, such as /dev/video0; needed if several are plugged in"
    )
    width: int = option(160, "width of the picture in pixels", range=(40, 3840))
    height: int = option(120, "height of the picture in pixels", range=(30, 2160))
    frame_rate: int = option(30, "pictures a second", range=(1, 120))
    encoding: str = option(
        "auto",
        "format of the pictures; auto chooses yuyv if the camera offers it",
        choices=("auto", "yuyv", "jpeg"),
    )


class V4l2Camera(ThreadedCamera):
    """Delivers the camera's frames unchanged, with the time stamps of the kernel's driver."""

    name: ClassVar[str] = "v4l2"
    options_type: ClassVar[type[Any]] = UsbCameraOptions
    _reader: CameraReader | None = None

    @property
    def device(self) -> str:
        return self._reader.same.device if self._reader is not None else ""

    def _begin(self) -> None:
        options = self.options
        reader = self._reader = CameraReader(
            options.device, options.width, options.height, options.frame_rate, options.encoding
        )
        reader.poll(time.monotonic())
        if reader.video is None:
            raise CameraError(reader.fault or "the camera cannot be opened")
        if reader.video.encoding == "jpeg" and importlib.util.find_spec("cv2") is None:
            path = reader.video.path
            reader.close()
            raise CameraError(
                f"the camera {path} has only MJPEG, which this computer cannot read; on a brick, "
                "use a camera with YUYV (such as a Logitech C270), or run the server on another "
                "computer (drivelesson brick agent ADDRESS)"
            )
        self._work(lambda: self._read(reader))

    def _read(self, reader: CameraReader) -> None:
        try:
            while not self._ending.is_set():
                self._tick(reader)
        finally:
            reader.close()

    def _tick(self, reader: CameraReader) -> None:
        """Wait at most 50 ms for a picture; publish it, or report the fault."""
        if reader.video is None:
            self.clock.wait(self._ending, 0.05)
        else:
            select.select([reader.video], [], [], 0.05)
        taken = reader.poll(time.monotonic())
        if taken is not None and reader.video is not None:
            self._publish(
                taken.data,
                width=reader.video.width,
                height=reader.video.height,
                encoding=Encoding(reader.video.encoding),
                captured_s=self._on_clock(taken.taken_s),
            )
        elif reader.fault is not None:
            self._report_fault(reader.fault)
