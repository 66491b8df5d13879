"""Any camera, film or network stream that OpenCV reads: for laptops and a Raspberry Pi."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from robot.clock import Clock
from robot.devices.freshness import REOPEN_S
from robot.devices.options import Options, option
from robot.devices.usb_camera import identity_of, number_of
from robot.devices.watched_camera import WatchedCamera
from robot.errors import CameraError, need
from robot.types import Encoding

JPEG_QUALITY = 80


@dataclass(frozen=True, slots=True, kw_only=True)
class OpencvOptions(Options):
    """Which source, and the size that frames are brought to."""

    source: str = option("0", "number of a camera, a film's file, or an address (URL)")
    width: int = option(160, "width of the picture in pixels", range=(40, 3840))
    height: int = option(120, "height of the picture in pixels", range=(30, 2160))


class OpencvCamera(WatchedCamera):
    """Frames through OpenCV, reduced and sent as JPEG.

    OpenCV goes on returning the last frame of an unplugged camera, and may block for seconds in
    a read; so exact repeats do not count, and a second thread watches the time. A film begins
    again at its end.
    """

    name: ClassVar[str] = "opencv"
    options_type: ClassVar[type[Any]] = OpencvOptions

    def __init__(self, options: OpencvOptions, clock: Clock) -> None:
        super().__init__(options, clock)
        self._identity: str | None = None
        """Of the camera that was opened first: afterwards no other is opened."""

    @property
    def _is_film(self) -> bool:
        return Path(self.options.source).is_file()

    def _begin(self) -> None:
        self._cv2 = need("cv2", "the camera 'opencv'", "camera")
        capture = self._open()
        if capture is None:
            raise CameraError(
                f"OpenCV cannot open {self.options.source!r}; plug the camera in, or name "
                "another number, file or address with --source"
            )
        self._watch_over(lambda: self._read(capture))

    def _open(self) -> Any:
        cv2, source = self._cv2, self.options.source
        if source.isdigit():
            number = int(source) if self._identity is None else number_of(self._identity)
            if number is None:
                return None
            capture = cv2.VideoCapture(number)
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.options.width)
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.options.height)
            capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        else:
            capture = cv2.VideoCapture(source)
        if capture.isOpened():
            if source.isdigit() and self._identity is None:
                self._identity = identity_of(int(source))
            return capture
        capture.release()
        return None

    def _read(self, capture: Any) -> None:
        """Read until the end; open again, after a pause, whatever gives no more pictures."""
        while not self._ending.is_set():
            if capture is not None:
                self._read_out(capture)
                capture.release()
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
                return  # to be opened again; the watching thread reports the fault

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
        if self._identity is not None and number_of(self._identity) is None:
            return (
                f"The camera {self.options.source} is unplugged, and no other is taken in its "
                "place; plug it into the socket where it was."
            )
        return f"The camera {self.options.source} {wrong}; check its cable."
