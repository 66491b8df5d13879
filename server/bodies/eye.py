"""The messages of a phone that is the robot's camera, and the phone's clock. Pure.

The phone sends pictures as bytes (a header of 16 bytes, then the JPEG) and other messages as text.
The robot answers with acknowledgements as on `/ws/video`, and sends text messages. See
docs/reference/protocol.md.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from dataclasses import dataclass
from typing import Any

from robot.devkit.pictures import Picture, read_jpeg
from robot.errors import RecordingError
from server.protocol import ErrorCode, ProtocolError, parse_object

HEADER = struct.Struct("<BBHId")
_EYE_FRAME, _COVERED = 3, 1
_MOST_TEXT = 500
CLOCK_SAMPLES = 8
"""Number of the newest pings from which the difference of the clocks is measured. Older pings do
not count, because a phone's clock drifts by milliseconds per minute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EyeFrame:
    """One picture of the phone, with the number and the time of capture that the phone gave it."""

    seq: int
    taken_ms: float
    is_covered: bool
    picture: Picture


class EyeClock:
    """Converts times of the phone's clock to the robot's clock.

    The robot pings the phone and uses the shortest of the last round trips. The robot assumes that
    the phone answered halfway between ping and pong, which is wrong by at most half the round trip.
    The robot measures the round trip itself, so a phone cannot claim a shorter one.
    """

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float]] = deque(maxlen=CLOCK_SAMPLES)

    def note(self, asked_ms: float, eye_ms: float, now_ms: float) -> None:
        """Record a ping sent at `asked_ms` and answered at `eye_ms` by the phone's clock."""
        if asked_ms <= now_ms:
            self._samples.append((now_ms - asked_ms, (asked_ms + now_ms) / 2 - eye_ms))

    def to_ours(self, eye_ms: float) -> float | None:
        """Convert a time of the phone to the robot's clock, in ms; None before the first pong."""
        if not self._samples:
            return None
        return eye_ms + min(self._samples)[1]


def parse_frame(message: bytes) -> EyeFrame:
    """Parse one picture.

    Raises:
        ProtocolError: If the picture is not valid; the error says why.
    """
    if len(message) <= HEADER.size:
        raise ProtocolError(
            ErrorCode.MALFORMED, "a picture must be a header of 16 bytes and then a JPEG"
        )
    kind, flags, _, seq, taken_ms = HEADER.unpack_from(message)
    if kind != _EYE_FRAME:
        raise ProtocolError(ErrorCode.UNKNOWN_TYPE, "a binary message must be a picture")
    if not math.isfinite(taken_ms):
        raise ProtocolError(ErrorCode.BAD_FIELD, "the time of a picture must be a finite number")
    try:
        picture = read_jpeg(message[HEADER.size :])
    except RecordingError as error:
        raise ProtocolError(ErrorCode.MALFORMED, str(error)) from error
    if picture.is_too_large:
        size = f"{picture.width}x{picture.height}"
        raise ProtocolError(ErrorCode.TOO_LARGE, f"a picture of {size} pixels is too large")
    is_covered = bool(flags & _COVERED)
    return EyeFrame(seq=seq, taken_ms=taken_ms, is_covered=is_covered, picture=picture)


def encode_frame(seq: int, taken_ms: float, jpeg: bytes, *, is_covered: bool = False) -> bytes:
    """Encode one picture in the format of the eye page."""
    return HEADER.pack(_EYE_FRAME, _COVERED if is_covered else 0, 0, seq, taken_ms) + jpeg


def parse_text(text: str) -> dict[str, Any]:
    """Parse one text message: `stop`, or `pong` with two finite numbers.

    Raises:
        ProtocolError: If the message is neither `stop` nor a valid `pong`.
    """
    message = parse_object(text if len(text) < _MOST_TEXT else "")
    kind = message.get("type")
    if kind == "pong":
        for name in ("server_ms", "eye_ms"):
            value: Any = message.get(name)
            if type(value) not in (int, float) or not abs(value) < 1e15:
                raise ProtocolError(ErrorCode.BAD_FIELD, f"{name!r} must be a number")
    elif kind != "stop":
        raise ProtocolError(ErrorCode.UNKNOWN_TYPE, "unknown message type; known types: stop, pong")
    return message
