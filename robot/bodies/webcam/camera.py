"""Reads any camera, film or network stream that OpenCV can read, on laptops and on a Raspberry
Pi."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devkit.freshness import REOPEN_S
from robot.devkit.threaded_camera import WatchedCamera
from robot.devkit.usb_camera import AUTO, SameCamera, SeveralCamerasError
from robot.errors import CameraError, need, told_as
from robot.types import Encoding

JPEG_QUALITY = 80


@dataclass(frozen=True, slots=True, kw_only=True)
class OpencvOptions(Options):
    """The camera or film to read, and the size to which its frames are reduced."""

    source: str = option(
        AUTO, "number of the camera (needed if several are plugged in), a film, or a URL"
    )
    width: int = option(160, "width of the picture in pixels", range=(40, 3840))
    height: int = option(120, "height of the picture in pixels", range=(30, 2160))


class OpencvCamera(WatchedCamera):
    """Reads frames by OpenCV, reduces them and encodes them as JPEG.

    OpenCV keeps returning the last frame of an unplugged camera, and a read may block for seconds.
    Exact repetitions of a frame are therefore ignored, and a second thread checks that new frames
    arrive. A film starts again at its end.
    """

    name: ClassVar[str] = "opencv"
    options_type: ClassVar[type[Any]] = OpencvOptions

    def __init__(self, options: OpencvOptions, clock: Clock) -> None:
        super().__init__(options, clock)
        source = options.source
        self._is_usb = source == AUTO or source.isdigit() or source.startswith("/dev/")
        wanted = f"/dev/video{source}" if source.isdigit() else source
        self._same = SameCamera(wanted, "--source")

    @property
    def device(self) -> str:
        return self._same.device

    @property
    def _is_film(self) -> bool:
        return Path(self.options.source).is_file()

    def _begin(self) -> None:
        self._cv2 = need("cv2", "the camera 'opencv'", "camera")
        with told_as(CameraError, "it is unclear which camera to use", SeveralCamerasError):
            capture = self._open()
        if capture is None:
            raise CameraError(
                f"OpenCV cannot open {self.options.source!r}; plug the camera in, or give "
                "another number, file or address with --source"
            )
        self._watch_over(lambda: self._read(capture))

    def _open(self) -> Any:
        cv2, source = self._cv2, self.options.source
        path = self._same.find() if self._is_usb else source
        if path is None:
            return None
        if self._is_usb:
            capture = cv2.VideoCapture(_number(path))
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.options.width)
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.options.height)
            capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        else:
            capture = cv2.VideoCapture(source)
        if capture.isOpened():
            if self._is_usb:
                self._same.opened(f"/dev/video{_number(path)}")
            return capture
        capture.release()
        return None

    def _read(self, capture: Any) -> None:
        """Read until the camera stops; if no pictures come, reopen the source after a pause."""
        while not self._ending.is_set():
            if capture is not None:
                self._read_out(capture)
                capture.release()
                self._same.lost()
            if not self._is_film:
                self.clock.wait(self._ending, REOPEN_S)
            capture = None if self._ending.is_set() else self._open()

    def _read_out(self, capture: Any) -> None:
        rate_hz = capture.get(self._cv2.CAP_PROP_FPS) if self._is_film else 0.0
        pause_s = 1.0 / rate_hz if 0 < rate_hz <= 1000 else 0.0
        while not self.clock.wait(self._ending, pause_s):
            is_read, picture = capture.read()
            now_s = self.clock.now_s()
            if is_read:
                self._take(picture, now_s)
            if not is_read or self._freshness.fault(now_s) is not None:
                # the second thread reports the fault, and the caller opens the source again later
                return

    def _take(self, pixels: Any, now_s: float) -> None:
        if not self._freshness.is_new(pixels.tobytes(), now_s):
            return
        cv2, size = self._cv2, (self.options.width, self.options.height)
        small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
        _, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        self._publish(
            jpeg.tobytes(), width=size[0], height=size[1], encoding=Encoding.JPEG, captured_s=now_s
        )

    def _name_fault(self, wrong: str) -> str:
        if self._same.is_absent:
            return (
                f"The camera {self.device} is unplugged, and no other camera replaces it; plug it "
                "into the same socket again."
            )
        return f"The camera {self.device or self.options.source} {wrong}; check its cable."


def _number(path: str) -> int:
    """Return OpenCV's number of the camera; 0 if the system lists no cameras."""
    digits = re.search(r"\d+$", os.path.realpath(path))
    return int(digits[0]) if digits else 0
