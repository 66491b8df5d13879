"""Any camera, film or network stream that OpenCV reads: for laptops and a Raspberry Pi."""

from __future__ import annotations

import importlib.util
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

from robot.camera import Camera
from robot.clock import Clock, Worker
from robot.devices.freshness import REOPEN_S, Freshness
from robot.driver import Driver
from robot.errors import CameraError, MissingExtraError
from robot.types import Encoding

JPEG_QUALITY = 80


@dataclass(frozen=True, slots=True, kw_only=True)
class OpencvOptions:
    """Which source, and the size that frames are brought to."""

    source: str = field(
        default="0", metadata={"help": "number of a camera, a film's file, or an address (URL)"}
    )
    width: int = field(
        default=160, metadata={"help": "width of the picture in pixels", "range": (40, 3840)}
    )
    height: int = field(
        default=120, metadata={"help": "height of the picture in pixels", "range": (30, 2160)}
    )


class OpencvCamera(Camera):
    """Frames through OpenCV, reduced and sent as JPEG.

    OpenCV goes on returning the last frame of an unplugged camera, and may block for seconds in
    a read; so exact repeats do not count, and a second thread watches the time. A film begins
    again at its end.
    """

    name: ClassVar[str] = "opencv"
    options_type: ClassVar[type[Any]] = OpencvOptions

    def __init__(self, options: OpencvOptions, clock: Clock) -> None:
        super().__init__(clock)
        self.options = options
        self._freshness = Freshness(0.0)
        self._ending = threading.Event()
        self._threads: list[Worker] = []

    @classmethod
    def for_driver(cls, driver: Driver, options: OpencvOptions, clock: Clock) -> Self:
        """Build the camera; it needs nothing of the driver."""
        return cls(options, clock)

    @property
    def _is_film(self) -> bool:
        return Path(self.options.source).is_file()

    def start(self) -> None:
        """Open the source and read it on a thread, with another that watches the time.

        Raises:
            CameraError: If it cannot be opened.
            MissingExtraError: If OpenCV is not installed.
        """
        if self._threads:
            return
        if importlib.util.find_spec("cv2") is None:
            raise MissingExtraError("the camera 'opencv'", "camera")
        capture = self._open()
        if capture is None:
            raise CameraError(
                f"OpenCV cannot open {self.options.source!r}; plug the camera in, or name "
                "another number, file or address with --source"
            )
        self._ending.clear()
        self._freshness = Freshness(self.clock.now_s())
        self._threads = [
            self.clock.start_thread(lambda: self._read(capture), "opencv-camera"),
            self.clock.start_thread(self._watch, "opencv-watch"),
        ]

    def stop(self) -> None:
        """End the threads and let go of the source; a read that hangs is left behind."""
        self._ending.set()
        for thread in self._threads:
            thread.join(timeout=2.0)
        self._threads.clear()

    def _open(self) -> Any:
        """Return an open capture, or None."""
        import cv2

        source = self.options.source
        if source.isdigit():
            capture = cv2.VideoCapture(int(source))
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.options.width)
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.options.height)
            capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        else:
            capture = cv2.VideoCapture(source)
        if capture.isOpened():
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
        import cv2

        rate_hz = capture.get(cv2.CAP_PROP_FPS) if self._is_film else 0.0
        pause_s = 1.0 / rate_hz if 0 < rate_hz <= 1000 else 0.0
        while not self.clock.wait(self._ending, pause_s):
            is_read, picture = capture.read()
            now_s = self.clock.now_s()
            if is_read:
                self._show(picture, now_s)
            if not is_read or self._freshness.fault(now_s) is not None:
                return  # to be opened again; the watching thread reports the fault

    def _show(self, picture: Any, now_s: float) -> None:
        import cv2

        if not self._freshness.is_new(picture.tobytes(), now_s):
            return
        size = (self.options.width, self.options.height)
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        _, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        self._publish(
            jpeg.tobytes(),
            width=size[0],
            height=size[1],
            encoding=Encoding.JPEG,
            captured_s=now_s,
        )

    def _watch(self) -> None:
        while not self.clock.wait(self._ending, 0.05):
            wrong = self._freshness.fault(self.clock.now_s())
            fault = f"The camera {self.options.source} {wrong}; check its cable." if wrong else None
            if fault is not None and self._fault is None:
                self._report_fault(fault)
