"""An MJPEG address: ESP32-CAM, IP camera, a phone with a camera app.

Pictures are not re-encoded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar
from urllib.parse import urlsplit

from robot.bodies.mjpeg.answer import PictureFinder
from robot.bodies.mjpeg.line import CameraLine
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devkit.freshness import LONGEST_PERIOD_S, REOPEN_S
from robot.devkit.pictures import check_kind, read_jpeg, read_picture, reduce_picture
from robot.devkit.threaded_camera import WatchedCamera
from robot.errors import CameraError, ConfigurationError, RecordingError, need

_JPEG = b"\xff\xd8"


@dataclass(frozen=True, slots=True, kw_only=True)
class MjpegOptions(Options):
    """The source of the pictures."""

    source: str = option(
        "", "address (URL) of the stream, such as http://192.168.4.1:81/stream", secret=True
    )


class MjpegCamera(WatchedCamera):
    """Reads the newest picture on one thread, which reopens the stream if it ends. A second thread
    reports if no pictures come.

    A picture's time is that of its first bytes, because the camera's delay is unknown.
    """

    name: ClassVar[str] = "mjpeg"
    options_type: ClassVar[type[Any]] = MjpegOptions
    longest_join_s: ClassVar[float] = 4.0

    def __init__(self, options: MjpegOptions, clock: Clock) -> None:
        super().__init__(options, clock)
        try:
            self._line = CameraLine(urlsplit(options.source))
        except ValueError as error:
            raise ConfigurationError(
                "the camera 'mjpeg' needs the address of a stream, "
                "as in --source http://192.168.4.1:81/stream"
            ) from error
        self._reason: str | None = None
        self._shown_s: float | None = None
        self._gap_s = 0.0

    def _begin(self) -> None:
        need("cv2", "the camera 'mjpeg'", "camera")
        self._line.open()
        self._watch_over(self._read)

    def _let_go(self) -> None:
        self._line.close()

    def _read(self) -> None:
        is_open = True
        while not self._ending.is_set():
            try:
                if not is_open:
                    self._line.open()
                self._read_out()
            except (CameraError, OSError, ValueError, AttributeError) as error:
                self._reason = str(error)  # the thread that watches the stream reports the reason
            is_open = False
            self._line.close()
            self.clock.wait(self._ending, REOPEN_S)

    def _read_out(self) -> None:
        finder, began_s = PictureFinder(), None
        self._reason = finder.explain()
        while not self._ending.is_set():
            try:
                data = self._line.read1(65_536)
            except TimeoutError as error:
                why = finder.explain() or self._reason or "nothing was received for 2 s"
                raise CameraError(why) from error
            now_s = self.clock.now_s()
            if not data:
                raise CameraError(finder.explain() or self._reason or _ended(finder.n_whole))
            pictures = finder.feed(data)
            if pictures:
                self._take(pictures[-1], now_s if began_s is None or pictures[1:] else began_s)
                began_s = None
            else:
                self._reason = finder.explain() or self._reason
            began_s = now_s if began_s is None and finder.has_begun else began_s

    def _take(self, data: bytes, captured_s: float) -> None:
        try:
            is_jpeg = data.startswith(_JPEG)
            picture = read_jpeg(data) if is_jpeg else read_picture(data, "its picture")
            if is_jpeg:
                check_kind(data)
        except RecordingError as error:
            self._reason = str(error)
            return
        if picture.is_too_large:
            self._reason = f"its pictures are {picture.width}x{picture.height}; choose smaller ones"
            return
        now_s = self.clock.now_s()
        self._reason = None
        if not self._freshness.is_new(data, now_s):
            return
        try:
            picture = reduce_picture(picture)
        except RecordingError as error:
            self._reason = str(error)
            return
        self._gap_s = 0.0 if self._shown_s is None else now_s - self._shown_s
        self._shown_s = now_s
        self._show_picture(picture, captured_s)

    def _name_fault(self, wrong: str) -> str:
        return f"The camera at {self._line.host} {self._explain(wrong)}."

    def _explain(self, wrong: str) -> str:
        since_s = self.clock.now_s() - (self._shown_s or 0.0)
        is_slow = self._gap_s > LONGEST_PERIOD_S and since_s < 1.5 * self._gap_s
        if is_slow and self._reason is None:
            return (
                f"gives a picture only every {self._gap_s:.1f} s, which is too slow to drive; "
                "choose a higher rate or smaller pictures in its settings"
            )
        if self._reason is None:
            return f"{wrong}; restart it" if wrong.startswith("repeats") else wrong
        return f"gives no pictures ({self._reason})"


def _ended(n_pictures: int) -> str:
    if n_pictures == 1:
        return (
            "it closes the connection after one picture; give the address of its stream instead "
            "of a picture's"
        )
    return "the stream ended"
