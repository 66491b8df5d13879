"""What a camera answers over HTTP, read as cameras write it: its head, then pictures. Pure.

What cameras write between their pictures differs: boundaries, line ends, blank lines, lengths that
are wrong. A JPEG and a PNG say themselves where they begin and end, so only that is believed.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from urllib import request as urllib_request

from robot.errors import CameraError

_BLANK = re.compile(rb"\r?\n[ \t]*\r?\n")
_STATUS = re.compile(r"[A-Za-z]+(?:/[\d.]*)?[ \t]+(\d{3})\b")
_CHUNK = re.compile(rb"[ \t]*([0-9a-fA-F]{0,7})[ \t]*(?:;.*)?\r?")
_MOST_HEAD_BYTES = 64 * 2**10
_PAGES = ("text/", "application/json", "application/xml", "application/xhtml")
_ADVICE = {
    403: "it lets nobody in from here; look into its settings",
    404: "there is nothing at this path; look up the address of the stream in its manual",
    503: "it is busy; end its other viewers, or restart it",
}
MAX_PART_BYTES = 4 * 2**20
_PNG = b"\x89PNG\r\n\x1a\n"
_START = re.compile(rb"\xff\xd8\xff|\x89PNG\r\n\x1a\n")
_IN_SCAN = re.compile(rb"\xff[\xc4\xd8-\xdd]")
"""What may follow in a scan: tables, a new scan, the end; or a new picture, if this one was cut."""
_TYPE = re.compile(rb"content-type:[ \t]*([\w/.+-]+)", re.IGNORECASE)
_SOI, _EOI, _SOS = 0xD8, 0xD9, 0xDA
_KEPT_BYTES = 256
"""Of what is no picture so much is kept: a head that has come in part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """Status and fields of an answer; a camera without a status line has answered with 200.

    Names of fields are in small letters; each has all its values.
    """

    status: int
    fields: dict[str, list[str]]

    def first(self, name: str) -> str:
        return self.fields.get(name, [""])[0]

    @property
    def kind(self) -> str:
        """The media type, without its parameters."""
        return self.first("content-type").partition(";")[0].strip().lower()

    @property
    def complaint(self) -> str | None:
        """Why there is no stream, and what to do; None if pictures may follow."""
        if self.status // 100 == 2 and not self.kind.startswith(_PAGES):
            return None
        advice = "that is a page; give the address of the stream itself, as its manual names it"
        if self.status // 100 != 2:
            advice = _ADVICE.get(self.status, "restart it, or look up the address in its manual")
        return f"answers {self.status} {self.kind}".rstrip() + f": {advice}"


def read_head(data: bytes) -> tuple[Head, int] | None:
    """Return the head of an answer and where its body begins; None if more has to come."""
    text_at = len(data) - len(data.lstrip(b"\r\n"))
    blank, picture = _BLANK.search(data, text_at), _START.search(data)
    ends = [found for found in (blank and blank.end(), picture and picture.start()) if found]
    if picture and picture.start() == 0:
        ends = [0]
    if not ends and len(data) < _MOST_HEAD_BYTES:
        return None
    end = min(ends, default=0)
    lines = data[text_at:end].decode("latin-1").splitlines()
    status = _STATUS.match(lines[0]) if lines else None
    fields: dict[str, list[str]] = {}
    for line in lines:
        name, colon, value = line.partition(":")
        if colon:
            fields.setdefault(name.strip().lower(), []).append(value.strip())
    if lines and lines[0].startswith("--"):  # the stream began at once
        return Head(status=200, fields={}), 0
    return Head(status=int(status[1]) if status else 200, fields=fields), end


class Chunks:
    """Takes the lengths out of a body that comes in chunks; what has none is passed on."""

    def __init__(self) -> None:
        self._buffer = b""
        self._left = 0
        self._is_plain = False

    def feed(self, data: bytes) -> bytes:
        self._buffer += data
        body = []
        while self._buffer:
            if self._left or self._is_plain:
                size = len(self._buffer) if self._is_plain else self._left
                body.append(self._buffer[:size])
                self._left = max(0, self._left - len(self._buffer))
                self._buffer = self._buffer[size:]
                continue
            line, end, rest = self._buffer.partition(b"\n")
            if not end and len(line) < 1024:
                break
            length = _CHUNK.fullmatch(line)
            self._is_plain = length is None
            if length is not None:
                self._left, self._buffer = int(length[1] or b"0", 16), rest
        return b"".join(body)


def basic(user: str, password: str) -> str:
    """Return the field `Authorization` for a camera that has not asked."""
    return "Basic " + base64.b64encode(f"{user}:{password}".encode()).decode()


def _is_sha256(challenge: dict[str, str]) -> bool:
    return challenge.get("algorithm", "").upper() == "SHA-256"


class _Digest(urllib_request.HTTPDigestAuthHandler):
    """Knows SHA-256, too; before Python 3.14 the library's does not."""

    def get_algorithm_impls(
        self, algorithm: str
    ) -> tuple[Callable[[str], str], Callable[[str, str], str]]:
        if algorithm.upper() != "SHA-256":
            return super().get_algorithm_impls(algorithm)
        return _sha256, lambda secret, data: _sha256(f"{secret}:{data}")


def _sha256(text: str) -> str:
    return sha256(text.encode()).hexdigest()


def digest(head: Head, address: str, user: str, password: str) -> str | None:
    """Return the field `Authorization` for a 401 that asks for a digest; None if it does not.

    Raises:
        ValueError: If the camera's kind of digest is not known here.
    """
    asked = [
        text for text in head.fields.get("www-authenticate", []) if text[:7].lower() == "digest "
    ]
    if not asked:
        return None
    challenges = [
        urllib_request.parse_keqv_list(
            [part for part in urllib_request.parse_http_list(text) if part]
        )
        for text in (text[7:] for text in asked)
    ]
    # A camera that knows several asks for the safest first, but need not.
    challenge = max(challenges, key=_is_sha256)
    passwords = urllib_request.HTTPPasswordMgrWithDefaultRealm()
    passwords.add_password(None, address, user, password)
    words = _Digest(passwords).get_authorization(urllib_request.Request(address), challenge)
    if words is None:
        raise ValueError("its question is incomplete")
    return f"Digest {words}"


class PictureFinder:
    """Cuts a stream into pictures, each when its last byte has come.

    Raises:
        CameraError: From `feed`, if a picture is larger than `MAX_PART_BYTES`.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._at = 0
        self._segment_at = 0
        """Where the last segment begins: if its length was wrong, the next picture is after it."""
        self._is_in_scan = False
        self._type = ""
        self._received = 0
        self._n_cut = 0
        self.n_whole = 0

    @property
    def has_begun(self) -> bool:
        """True if part of the next picture is there."""
        return _START.match(self._buffer) is not None

    def feed(self, data: bytes) -> list[bytes]:
        """Take in more of the stream, and return the pictures that are complete now."""
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
        """Say why there are no pictures, as the end of a sentence; None if there are."""
        if self.n_whole:
            return None
        if self._n_cut:
            return "its pictures are cut or damaged; choose smaller ones, or a lower rate"
        if self.has_begun:
            return "a picture has begun and does not end; choose a smaller one in its settings"
        if not self._received:
            return "it has answered and sends nothing; end its other viewers, or restart it"
        kind = self._type or "something"
        return f"it sends {kind} in which there is no JPEG or PNG; choose MJPEG in its settings"

    def _go_to_start(self) -> bool:
        start = _START.search(self._buffer)
        head = self._buffer[: start.start() if start else None]
        for kind in _TYPE.findall(head):
            self._type = kind.decode("ascii")
        del self._buffer[: start.start() if start else max(0, len(head) - _KEPT_BYTES)]
        return start is not None

    def _jpeg_end(self) -> int | None:
        """Return where the JPEG ends; 0 if it is cut or damaged, None if more has to come."""
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
            if kind == 0xFF:  # a marker may be filled up
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
        """Return where the PNG ends; 0 if it is cut or damaged, None if more has to come."""
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
