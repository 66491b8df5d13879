"""Reads a camera's HTTP response: the head, then pictures.

Cameras send different bytes between their pictures: boundaries, line ends, blank lines, wrong
lengths. Only the markers at the start and end of a JPEG or PNG are therefore trusted.
"""

from __future__ import annotations

import re
from http.client import HTTPMessage, HTTPResponse

from robot.errors import CameraError

_STATUS = re.compile(rb"[A-Za-z]+(?:/[\d.]*)?[ \t]+(\d{3})\b")
_CHUNK = re.compile(rb"[ \t]*([0-9a-fA-F]{0,7})[ \t]*(?:;.*)?\r?\n?")
_MOST_HEAD_BYTES = 64 * 2**10
MAX_PART_BYTES = 4 * 2**20
_PNG = b"\x89PNG\r\n\x1a\n"
_START = re.compile(rb"\xff\xd8\xff|\x89PNG\r\n\x1a\n")
_IN_SCAN = re.compile(rb"\xff[\xc4\xd8-\xdd]")
"""The JPEG markers that may follow the data of a scan: tables, another scan, or the picture's end.
The start of a new picture is among these markers, because the current picture may be truncated."""
_TYPE = re.compile(rb"content-type:[ \t]*([\w/.+-]+)", re.IGNORECASE)
_SOI, _EOI, _SOS = 0xD8, 0xD9, 0xDA
_KEPT_BYTES = 256
"""Bytes before a picture's start are discarded, except for the last `_KEPT_BYTES`, which may belong
to an incomplete header."""


class Answer(HTTPResponse):
    """A camera's response, which may have no status line, or no head. The header Content-Length is
    ignored.

    If a camera announces chunks but sends data without the lengths of chunks, the data is passed on
    unchanged.
    """

    _is_silent = False
    _left = 0

    def begin(self) -> None:
        """Read the head of the response, which ends at a blank line, at the first picture, or at a
        timeout."""
        head = line = b""
        try:
            while (line.strip() or not head.strip()) and len(head) < _MOST_HEAD_BYTES:
                line = self.fp.readline(_MOST_HEAD_BYTES)
                head += line
                if not line or _START.search(line):
                    break
        except TimeoutError:
            if not head.strip():
                raise
            self._is_silent = True
        if not head.strip():
            raise ConnectionError("it closed the connection without an answer")
        picture = _START.search(head)
        end = picture.start() if picture else len(head)
        if head.lstrip().startswith(b"--"):  # without a head, the pictures begin immediately
            end = 0
        text, self._rest = head[:end].lstrip(), head[end:]
        status = _STATUS.match(text)
        self.headers = self.msg = HTTPMessage()
        for field in text.splitlines():  # a line that is not a header field is skipped
            name, colon, value = field.decode("latin-1").partition(":")
            if colon:
                self.headers[name.strip()] = value.strip()
        self.code = self.status = int(status[1]) if status else 200
        self.reason, self.version, self.will_close, self.chunked = "", 10, True, False
        self.length = None if self.status // 100 == 2 else 0
        self._is_chunked = "chunked" in self.headers.get("transfer-encoding", "").lower()

    def read1(self, n: int = -1) -> bytes:
        if self._rest:
            data, self._rest = self._rest, b""
            return data
        if self._is_silent:
            raise TimeoutError("timed out")
        while self._is_chunked and not self._left:
            line = self.fp.readline(_MOST_HEAD_BYTES)
            length = _CHUNK.fullmatch(line) if line else None
            if length is None:
                self._is_chunked = False
                return line
            self._left = int(length[1] or b"0", 16)
        data = super().read1(min(n, self._left) if self._is_chunked else n)
        self._left = max(0, self._left - len(data))
        return data


class PictureFinder:
    """Splits a stream into pictures, each as soon as its last byte has arrived.

    Raises:
        CameraError: From `feed`, if a picture is larger than `MAX_PART_BYTES`.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._at = 0
        self._segment_at = 0
        """Position of the JPEG's last segment. If the JPEG is damaged, the search for the next
        picture begins here."""
        self._is_in_scan = False
        self._type = ""
        self._received = 0
        self._n_cut = 0
        self.n_whole = 0

    @property
    def has_begun(self) -> bool:
        """True if a part of the next picture has arrived."""
        return _START.match(self._buffer) is not None

    def feed(self, data: bytes) -> list[bytes]:
        """Add bytes of the stream, and return the pictures that are now complete."""
        self._buffer += data
        self._received += len(data)
        found = []
        while self._go_to_start():
            end = self._png_end() if self._buffer.startswith(_PNG) else self._jpeg_end()
            if end is None:
                break
            if end:
                found.append(bytes(self._buffer[:end]))
                self.n_whole += 1
            else:
                self._n_cut += 1
            del self._buffer[: end or max(self._segment_at, 2)]
            self._at, self._segment_at, self._is_in_scan = 0, 0, False
        if len(self._buffer) > MAX_PART_BYTES:
            raise CameraError("a picture of the stream is larger than 4 MB")
        return found

    def explain(self) -> str | None:
        """Return the reason why no pictures arrive, for an error message; None if they arrive."""
        if self.n_whole:
            return None
        if self._n_cut:
            return "its pictures are cut off or damaged; choose smaller pictures, or a lower rate"
        if self.has_begun:
            return "a picture began but did not end; choose smaller pictures in its settings"
        if not self._received:
            return "it answered, but sends nothing; close its other viewers, or restart it"
        kind = self._type or "something"
        return f"it sends {kind} without any JPEG or PNG picture; choose MJPEG in its settings"

    def _go_to_start(self) -> bool:
        start = _START.search(self._buffer)
        head = self._buffer[: start.start() if start else None]
        for kind in _TYPE.findall(head):
            self._type = kind.decode("ascii")
        del self._buffer[: start.start() if start else max(0, len(head) - _KEPT_BYTES)]
        return start is not None

    def _jpeg_end(self) -> int | None:
        """Return the end of the JPEG; 0 if it is truncated or damaged, None if it is incomplete."""
        buffer, at = self._buffer, self._at or 2
        while True:
            self._at = at
            if self._is_in_scan:
                mark = _IN_SCAN.search(buffer, at)
                if mark is None:
                    self._at = max(at, len(buffer) - 1)
                    return None
                self._at = at = mark.start()
                self._is_in_scan = False
            if len(buffer) < at + 2:
                return None
            kind = buffer[at + 1]
            if buffer[at] != 0xFF or kind in (0x00, _SOI):
                return 0
            if kind == _EOI:
                return at + 2
            if kind == 0xFF:  # bytes of padding may precede a marker
                at += 1
                continue
            if len(buffer) < at + 4:
                return None
            length = int.from_bytes(buffer[at + 2 : at + 4], "big")
            if length < 2:
                return 0
            self._is_in_scan = kind == _SOS
            self._segment_at = at
            at += 2 + length

    def _png_end(self) -> int | None:
        """Return where the PNG ends; 0 if the PNG is damaged, None if more data must come."""
        at = self._at or len(_PNG)
        while len(self._buffer) >= at + 8:
            self._at = at
            length = int.from_bytes(self._buffer[at : at + 4], "big")
            kind = self._buffer[at + 4 : at + 8]
            if not kind.isalpha() or length > MAX_PART_BYTES:
                return 0
            end = at + 12 + length
            if kind == b"IEND":
                return end if len(self._buffer) >= end else None
            at = end
        return None
