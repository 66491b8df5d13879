"""An MJPEG address: ESP32-CAM, IP camera, a phone with a camera app. The bytes stay as they are."""

from __future__ import annotations

import base64
import contextlib
import re
import socket
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from typing import Any, ClassVar
from urllib.parse import unquote, urlsplit

from robot.clock import Clock
from robot.devices.freshness import REOPEN_S
from robot.devices.pictures import MAX_SIDE_PX, jpeg_size
from robot.devices.watched_camera import WatchedCamera
from robot.errors import CameraError, ConfigurationError, RecordingError
from robot.types import Encoding

MAX_PART_BYTES = 4 * 2**20
_SILENT_S = 2.0
_LENGTH = re.compile(rb"content-length:\s*(\d{1,9})", re.IGNORECASE)
_SOI, _HEAD_END = b"\xff\xd8", b"\r\n\r\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class MjpegOptions:
    """Where the pictures come from."""

    source: str = field(
        default="",
        metadata={"help": "address (URL) of the stream, as http://192.168.4.1:81/stream"},
    )


class Parts:
    """Cuts a multipart stream into pictures. Pure: bytes in, whole pictures out.

    Args:
        boundary: What stands between the parts, without its two dashes.

    Raises:
        CameraError: From `feed`, if a part is larger than `MAX_PART_BYTES`.
    """

    def __init__(self, boundary: bytes) -> None:
        self._mark = b"--" + boundary
        self._buffer = bytearray()

    @property
    def has_begun(self) -> bool:
        """True if part of the next picture is there."""
        return _SOI in self._buffer

    def feed(self, data: bytes) -> list[bytes]:
        """Take in more of the stream, and return the pictures that are complete now."""
        self._buffer += data
        found = []
        while (picture := self._next()) is not None:
            if picture.startswith(_SOI):
                found.append(picture)
        if len(self._buffer) > MAX_PART_BYTES:
            raise CameraError("a picture of the stream is larger than 4 MB")
        return found

    def _next(self) -> bytes | None:
        start = self._buffer.find(self._mark)
        head_end = self._buffer.find(_HEAD_END, max(start, 0))
        if start < 0 or head_end < 0:
            return None
        begin = head_end + len(_HEAD_END)
        length = _LENGTH.search(self._buffer, start, head_end)
        if length is not None:
            end = begin + int(length[1])
            if end > begin + MAX_PART_BYTES:
                raise CameraError("a picture of the stream is larger than 4 MB")
            if len(self._buffer) < end:
                return None
        else:
            end = self._buffer.find(self._mark, begin)
            if end < 0:
                return None
        picture = bytes(self._buffer[begin:end])
        del self._buffer[:end]
        return picture if length is not None else picture.removesuffix(b"\r\n")


class MjpegCamera(WatchedCamera):
    """Reads on a thread, newest only; another watches the time. A lost stream is opened again.

    A picture is stamped when its first bytes came: the camera's own delay is not known.
    """

    name: ClassVar[str] = "mjpeg"
    options_type: ClassVar[type[Any]] = MjpegOptions

    def __init__(self, options: MjpegOptions, clock: Clock) -> None:
        super().__init__(options, clock)
        url = urlsplit(options.source)
        if url.scheme not in ("http", "https") or not url.hostname:
            raise ConfigurationError(
                f"the camera 'mjpeg' needs the address of a stream, not {options.source!r}; "
                "as in --source http://192.168.4.1:81/stream"
            )
        self._url = url
        self._socket: socket.socket | None = None
        self._reason: str | None = None

    def start(self) -> None:
        """Open the stream, and read it on a thread.

        Raises:
            CameraError: If there is no stream at this address; says what was there.
            MissingExtraError: If the libraries that read JPEG are not installed.
        """
        if self._threads:
            return
        self._need("cv2", "imagesize")
        stream = self._open()
        self._watch_over(lambda: self._read(stream))

    def stop(self) -> None:
        """End the threads and close the stream."""
        self._ending.set()
        self._close()
        self._join(2 * _SILENT_S)

    def _open(self) -> HTTPResponse:
        url = self._url
        kind = HTTPSConnection if url.scheme == "https" else HTTPConnection
        line = kind(url.hostname or "", url.port, timeout=_SILENT_S)
        headers = {"User-Agent": "drivelesson"}
        if url.username is not None:
            user = f"{unquote(url.username)}:{unquote(url.password or '')}"
            headers["Authorization"] = "Basic " + base64.b64encode(user.encode()).decode()
        path = (url.path or "/") + (f"?{url.query}" if url.query else "")
        try:
            line.connect()
            self._socket = line.sock  # an answer without length takes it away from the line
            line.request("GET", path, headers=headers)
            answer = line.getresponse()
        except (OSError, HTTPException) as error:
            self._close()
            raise CameraError(
                f"the camera at {url.hostname} does not answer ({error}); is it switched on and in "
                "the same network?"
            ) from error
        if answer.status != 200 or answer.msg.get_boundary() is None:
            self._close()
            raise CameraError(
                f"{url.hostname}{path} answers {answer.status} {answer.msg.get_content_type()}; a "
                "stream answers 200 multipart/x-mixed-replace"
            )
        return answer

    def _close(self) -> None:
        """End the connection, whoever still holds its stream, and wake a thread that reads.

        A camera that serves one client at a time would serve nobody else until then.
        """
        sock, self._socket = self._socket, None
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
            sock.close()

    def _read(self, stream: HTTPResponse | None) -> None:
        while not self._ending.is_set():
            try:
                self._read_out(stream or self._open())
            except (CameraError, OSError, HTTPException, AttributeError) as error:
                self._reason = str(error)  # the watching thread says so
            stream = None
            self._close()
            self.clock.wait(self._ending, REOPEN_S)

    def _read_out(self, stream: HTTPResponse) -> None:
        boundary = (stream.msg.get_boundary() or "").encode().removeprefix(b"--")
        parts, began_s = Parts(boundary), None
        while not self._ending.is_set():
            data = stream.read1(65_536)
            now_s = self.clock.now_s()
            if not data:
                raise CameraError("the stream ended")
            began_s = now_s if began_s is None else began_s
            pictures = parts.feed(data)
            if pictures:
                self._show(pictures[-1], began_s)
                began_s = now_s if parts.has_begun else None

    def _show(self, jpeg: bytes, captured_s: float) -> None:
        try:
            width, height = jpeg_size(jpeg)
        except RecordingError:
            return
        if max(width, height) > MAX_SIDE_PX or not self._freshness.is_new(jpeg, self.clock.now_s()):
            return
        self._reason = None
        self._publish(
            jpeg, width=width, height=height, encoding=Encoding.JPEG, captured_s=captured_s
        )

    def _name_fault(self, wrong: str) -> str:
        why = f" ({self._reason})" if self._reason else ""
        return f"The camera at {self._url.hostname} {wrong}{why}."
