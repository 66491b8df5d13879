"""The messages between page and robot: bytes or text on the wire, dataclasses in the code. Pure.

Described in docs/reference/protocol.md; `web/js/protocol.js` is its mirror, and both pass the
messages in tests/vectors/.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NoReturn

from robot.types import Action, Encoding, Mode

PROTOCOL_VERSION = 1
MAX_DRIVE_MESSAGE_BYTES = 4096
"""A longer message on `/ws/drive` is refused with `too_large` and not even parsed."""
MAX_COUNT = 2**53 - 1
"""The largest whole number that JavaScript can count to."""
FRAME_HEADER = struct.Struct("<BBHHHIId")
ACKNOWLEDGEMENT = struct.Struct("<BBHI")
_FRAME, _ACKNOWLEDGEMENT = 1, 2
_QUIET = 1
_ENCODINGS = (Encoding.JPEG, Encoding.YUYV, Encoding.RGB)


class ErrorCode(StrEnum):
    """Why a message was refused."""

    MALFORMED = "malformed"
    TOO_LARGE = "too_large"
    UNKNOWN_TYPE = "unknown_type"
    BAD_FIELD = "bad_field"
    OUT_OF_ORDER = "out_of_order"
    NOT_PILOT = "not_pilot"
    TOO_FAST = "too_fast"
    UNKNOWN_FRAME = "unknown_frame"
    STALE = "stale"
    NO_PICTURE = "no_picture"
    TEACHER_STOP = "teacher_stop"


class ProtocolError(ValueError):
    """A message that is refused; `seq` is the message's own where it had one."""

    def __init__(self, code: ErrorCode, message: str, seq: int | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.seq = seq


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveMessage:
    """The move that the pilot holds and the frame on the screen: command and heartbeat in one.

    `nonce` is the newest that the page has received. `frame_age_ms` is how old that frame is as
    the page reckons it, and `phone_ms` how much of that it has spent on the phone; None if the
    page cannot say.
    """

    held: Action | None
    frame: int | None
    seq: int
    nonce: int | None = None
    frame_age_ms: float | None = None
    phone_ms: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeMessage:
    """Change the mode: start again after any stop, or stop."""

    mode: Mode
    seq: int
    frame: int | None = None
    nonce: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Emergency stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """Release the emergency stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Take:
    """Ask for the wheel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Yield:
    """Give the wheel away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Idle:
    """This page shows no picture: states may be few."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """This page shows the picture again: states ten times a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ping:
    """Answered by a pong at once; `client_ms` goes back as it came."""

    client_ms: float


BareMessage = Stop | Release | Take | Yield | Idle | Watch
ClientMessage = DriveMessage | ModeMessage | BareMessage | Ping


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoFrame:
    """One frame of `/ws/video`: the fields of its header, and the picture itself.

    A `quiet` frame need not be acknowledged: a later one will be, and stands for it. `nonce`
    comes back with the next command and proves that it was sent later; 0 is none.
    """

    frame_id: int
    captured_ms: float
    encoding: Encoding
    width: int
    height: int
    data: bytes = field(repr=False)
    quiet: bool = False
    nonce: int = 0


def parse_message(text: str, moves: Collection[Action]) -> ClientMessage:
    """Parse one message of `/ws/drive`.

    Raises:
        ProtocolError: If it is not valid; says which field and why.
    """
    if (
        len(text) > MAX_DRIVE_MESSAGE_BYTES
        or len(text.encode("utf-8", "replace")) > MAX_DRIVE_MESSAGE_BYTES
    ):
        raise ProtocolError(
            ErrorCode.TOO_LARGE, f"a message has at most {MAX_DRIVE_MESSAGE_BYTES} bytes"
        )
    message = _parse_object(text)
    seq = _sane_seq(message)
    kind = message.get("type")
    if kind == "drive":
        return _parse_drive(message, seq, moves)
    if kind == "mode":
        return ModeMessage(
            mode=_parse_mode(message, seq),
            seq=_require_seq(message),
            frame=_parse_id(message, "frame", seq),
            nonce=_parse_id(message, "nonce", seq),
        )
    if kind == "ping":
        return Ping(client_ms=_parse_number(message, "client_ms", seq))
    if isinstance(kind, str) and kind in _BARE_MESSAGES:
        return _BARE_MESSAGES[kind]()
    known = ", ".join(["drive", "mode", "ping", *_BARE_MESSAGES])
    raise ProtocolError(ErrorCode.UNKNOWN_TYPE, f"unknown message type; known types: {known}", seq)


_BARE_MESSAGES: Mapping[str, type[BareMessage]] = {
    "stop": Stop,
    "release": Release,
    "take": Take,
    "yield": Yield,
    "idle": Idle,
    "watch": Watch,
}


def is_stop(text: str) -> bool:
    """True if this is an emergency stop, which no limit may hold up."""
    if len(text) > MAX_DRIVE_MESSAGE_BYTES or '"stop"' not in text:
        return False
    try:
        return _parse_object(text).get("type") == "stop"
    except ProtocolError:
        return False


def _parse_object(text: str) -> dict[str, Any]:
    try:
        message = _DECODER.decode(text)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(ErrorCode.MALFORMED, "a message is one JSON object") from error
    if not isinstance(message, dict):
        raise ProtocolError(ErrorCode.MALFORMED, "a message is one JSON object")
    return message


def _refuse_constant(name: str) -> NoReturn:
    """JSON knows neither NaN nor infinity, though Python's parser does."""
    raise ValueError(name)


_DECODER = json.JSONDecoder(parse_constant=_refuse_constant)


def _parse_drive(
    message: dict[str, Any], seq: int | None, moves: Collection[Action]
) -> DriveMessage:
    held = message.get("held")
    if held is not None and held not in moves:
        raise _bad_field("held", f"one of {', '.join(moves)} or null", seq)
    return DriveMessage(
        held=Action(held) if held is not None else None,
        frame=_parse_id(message, "frame", seq),
        seq=_require_seq(message),
        nonce=_parse_id(message, "nonce", seq),
        frame_age_ms=_parse_optional_number(message, "frame_age_ms", seq),
        phone_ms=_parse_optional_number(message, "phone_ms", seq),
    )


def _parse_id(message: dict[str, Any], name: str, seq: int | None) -> int | None:
    value = message.get(name)
    if value is None:
        return None
    if not _is_count(value, 2**32 - 1):
        raise _bad_field(name, "a whole number from 1 that fits into 32 bits, or null", seq)
    return int(value)


def _parse_optional_number(message: dict[str, Any], name: str, seq: int | None) -> float | None:
    return None if message.get(name) is None else _parse_number(message, name, seq)


def _parse_mode(message: dict[str, Any], seq: int | None) -> Mode:
    mode = message.get("mode")
    if not isinstance(mode, str) or mode not in list(Mode):
        raise _bad_field("mode", f"one of {', '.join(Mode)}", seq)
    return Mode(mode)


def _parse_number(message: dict[str, Any], name: str, seq: int | None) -> float:
    value = message.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _bad_field(name, "a number", seq)
    if not math.isfinite(value) or abs(value) > MAX_COUNT:
        raise _bad_field(name, f"a finite number up to {MAX_COUNT}", seq)
    return value


def _require_seq(message: dict[str, Any]) -> int:
    seq = _sane_seq(message)
    if seq is None:
        raise _bad_field("seq", "a whole number from 1 that grows", None)
    return seq


def _sane_seq(message: dict[str, Any]) -> int | None:
    seq = message.get("seq")
    return seq if _is_count(seq, MAX_COUNT) else None


def _is_count(value: object, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= most


def _bad_field(name: str, wanted: str, seq: int | None) -> ProtocolError:
    return ProtocolError(ErrorCode.BAD_FIELD, f"{name!r} must be {wanted}", seq)


def encode_picture(picture: VideoFrame) -> bytes:
    """Encode a frame as a message of `/ws/video`."""
    header = FRAME_HEADER.pack(
        _FRAME,
        _ENCODINGS.index(picture.encoding),
        picture.width,
        picture.height,
        _QUIET if picture.quiet else 0,
        picture.frame_id,
        picture.nonce,
        picture.captured_ms,
    )
    return header + picture.data


def parse_picture(message: bytes) -> VideoFrame:
    """Parse a message of `/ws/video`.

    Raises:
        ProtocolError: If it is not valid.
    """
    if len(message) < FRAME_HEADER.size:
        raise ProtocolError(ErrorCode.MALFORMED, "a frame starts with a header of 24 bytes")
    kind, encoding, width, height, flags, frame_id, nonce, captured_ms = FRAME_HEADER.unpack_from(
        message
    )
    if kind != _FRAME or encoding >= len(_ENCODINGS):
        raise ProtocolError(ErrorCode.UNKNOWN_TYPE, "not a frame of a known encoding")
    return VideoFrame(
        frame_id=frame_id,
        captured_ms=captured_ms,
        encoding=_ENCODINGS[encoding],
        width=width,
        height=height,
        data=message[FRAME_HEADER.size :],
        quiet=bool(flags & _QUIET),
        nonce=nonce,
    )


def encode_acknowledgement(frame_id: int) -> bytes:
    """Encode the acknowledgement of a drawn frame."""
    return ACKNOWLEDGEMENT.pack(_ACKNOWLEDGEMENT, 0, 0, frame_id)


def parse_acknowledgement(message: bytes) -> int:
    """Return the id of the frame that was drawn.

    Raises:
        ProtocolError: If the message is not an acknowledgement.
    """
    if len(message) > ACKNOWLEDGEMENT.size:
        raise ProtocolError(ErrorCode.TOO_LARGE, "an acknowledgement has 8 bytes")
    if len(message) < ACKNOWLEDGEMENT.size:
        raise ProtocolError(ErrorCode.MALFORMED, "an acknowledgement has 8 bytes")
    kind, _, _, frame_id = ACKNOWLEDGEMENT.unpack(message)
    if kind != _ACKNOWLEDGEMENT:
        raise ProtocolError(ErrorCode.UNKNOWN_TYPE, "this socket receives acknowledgements only")
    return int(frame_id)


def encode_message(kind: str, **fields: Any) -> str:
    """Encode one message for the page: `hello`, `state`, `pong` or `event`."""
    return _ENCODER.encode({"type": kind, **fields})


_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)


def encode_error(error: ProtocolError) -> str:
    """Encode the answer to a refused message."""
    seq = {} if error.seq is None else {"seq": error.seq}
    return encode_message("error", code=error.code.value, message=str(error), **seq)
