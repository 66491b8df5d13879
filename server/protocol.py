"""The messages between page and robot: bytes or text on the wire, dataclasses in Python. No I/O.

docs/reference/protocol.md describes the messages. `web/js/protocol.js` is the page's counterpart of
this module, and tests/vectors/ tests both.
"""

from __future__ import annotations

import contextlib
import json
import struct
from collections.abc import Collection
from dataclasses import dataclass, field, fields
from enum import StrEnum
from typing import Any, NoReturn

from robot.devices.raw_value import number, whole
from robot.types import Action, Encoding, Frame, Mode, Point

PROTOCOL_VERSION = 1
MAX_DRIVE_MESSAGE_BYTES = 4096
"""Maximum size of a message on `/ws/drive`, in bytes; a longer one is refused without parsing."""
MAX_COUNT = 2**53 - 1
"""The largest whole number that JavaScript represents exactly."""
_MOST_ID = 2**32 - 1
FRAME_HEADER = struct.Struct("<BBHHHIId")
ACKNOWLEDGEMENT = struct.Struct("<BBHI")
_FRAME, _ACKNOWLEDGEMENT = 1, 2
_QUIET = 1
_ENCODINGS = (Encoding.JPEG, Encoding.YUYV, Encoding.RGB)


class ErrorCode(StrEnum):
    """The reason why a message was refused."""

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
    STOP_HELD = "stop_held"
    NEWER_STOP = "newer_stop"


class ProtocolError(ValueError):
    """A message that is refused; `seq` is the number of the message, if it has one."""

    def __init__(self, code: ErrorCode, message: str, seq: int | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.seq = seq


def _checked(kind: type[Any], least: int, most: int, **default: Any) -> Any:
    """Declare a number field with limits; with a default, it may be null or left out."""
    declare, types = (whole, (int,)) if kind is int else (number, (int, float))
    wanted = declare(least=least, most=most).description + (", or null" if default else "")
    return field(metadata={"check": (bool(default), types, least, most, wanted)}, **default)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveMessage:
    """The move that the pilot holds, and the frame on the screen; also serves as a heartbeat.

    `seq` grows with each message. `nonce` is the newest nonce that the page has received.
    `frame_age_ms` is the page's estimate of the frame's age, which includes the phone's own delay
    `phone_ms`. `steering` and `throttle` are set if the pilot steers proportionally.
    """

    held: Action | None
    seq: int = _checked(int, 1, MAX_COUNT)
    frame: int | None = _checked(int, 1, _MOST_ID, default=None)
    nonce: int | None = _checked(int, 1, _MOST_ID, default=None)
    frame_age_ms: float | None = _checked(float, -MAX_COUNT, MAX_COUNT, default=None)
    phone_ms: float | None = _checked(float, -MAX_COUNT, MAX_COUNT, default=None)
    steering: float | None = _checked(float, -1, 1, default=None)
    throttle: float | None = _checked(float, -1, 1, default=None)

    @property
    def point(self) -> Point | None:
        """The steering and throttle that the pilot holds; None if the pilot uses buttons."""
        if self.steering is None or self.throttle is None:
            return None
        return Point(self.steering, self.throttle)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeMessage:
    """Request to change the mode of the robot."""

    mode: Mode
    seq: int = _checked(int, 1, MAX_COUNT)
    frame: int | None = _checked(int, 1, _MOST_ID, default=None)
    nonce: int | None = _checked(int, 1, _MOST_ID, default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ping:
    """Request for a pong, which the server sends immediately with the same `client_ms`."""

    client_ms: float = _checked(float, -MAX_COUNT, MAX_COUNT)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReleaseMessage:
    """Request to release the emergency stop; it names the stop that the sender has seen."""

    stop_number: int = _checked(int, 1, MAX_COUNT)


class BareMessage(StrEnum):
    """A message that contains only its type."""

    STOP = "stop"
    """Latch the emergency stop."""
    TAKE = "take"
    """Request the wheel."""
    YIELD = "yield"
    """Give the wheel away."""
    IDLE = "idle"
    """Request the state less often, because this page shows no picture."""
    WATCH = "watch"
    """Request the state ten times a second again, because this page now shows the picture."""


ClientMessage = DriveMessage | ModeMessage | ReleaseMessage | BareMessage | Ping


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoFrame(Frame):
    """One message of `/ws/video` to a client.

    A client does not have to acknowledge a `quiet` frame. The client's next command contains
    `nonce` (0: none), which proves that the command is newer than the frame.
    """

    quiet: bool = False
    nonce: int = 0


def parse_message(
    text: str, moves: Collection[Action], *, takes_points: bool = False
) -> ClientMessage:
    """Parse one message of `/ws/drive`; with `takes_points`, it may have steering and throttle.

    Raises ProtocolError if the message is invalid; the error names the field and the reason. All
    parsing functions of this module raise this error.
    """
    if len(text.encode("utf-8", "replace")) > MAX_DRIVE_MESSAGE_BYTES:
        raise ProtocolError(
            ErrorCode.TOO_LARGE, f"a message may have at most {MAX_DRIVE_MESSAGE_BYTES} bytes"
        )
    message = parse_object(text)
    seq = message.get("seq")
    if type(seq) is not int or not 1 <= seq <= MAX_COUNT:
        seq = None
    kind: Any = message.get("type")
    if kind == "drive":
        held = message.get("held")
        if held is not None and held not in moves:
            raise _bad_field("held", f"one of {', '.join(moves)} or null", seq)
        numbers = _read(_DRIVE, message, seq)
        _check_point(numbers, takes_points and held is not None, seq)
        return DriveMessage(held=held and Action(held), **numbers)
    if kind == "mode":
        mode: Any = message.get("mode")
        if mode not in _MODES:
            raise _bad_field("mode", f"one of {', '.join(Mode)}", seq)
        return ModeMessage(mode=Mode(mode), **_read(_MODE, message, seq))
    if kind == "ping":
        return Ping(**_read(_PING, message, seq))
    if kind == "release":
        return ReleaseMessage(**_read(_RELEASE, message, seq))
    if kind in _BARE:
        return BareMessage(kind)
    known = ", ".join(["drive", "mode", "ping", "release", *BareMessage])
    raise ProtocolError(ErrorCode.UNKNOWN_TYPE, f"unknown message type; known types: {known}", seq)


def is_stop(text: str) -> bool:
    """True if a message is an emergency stop. Must be quick, as it runs for every message."""
    if len(text) > MAX_DRIVE_MESSAGE_BYTES or '"stop"' not in text:
        return False
    try:
        return parse_object(text).get("type") == "stop"
    except ProtocolError:
        return False


def parse_object(text: str) -> dict[str, Any]:
    """Parse a text that must be one JSON object; NaN and infinity are refused."""
    with contextlib.suppress(ValueError, RecursionError):
        message = _DECODER.decode(text)
        if isinstance(message, dict):
            return message
    raise ProtocolError(ErrorCode.MALFORMED, "a message must be one JSON object")


def _refuse_constant(name: str) -> NoReturn:
    """Refuse NaN and infinity, which Python's parser accepts although JSON does not have them."""
    raise ValueError(name)


_DECODER = json.JSONDecoder(parse_constant=_refuse_constant)


_Check = tuple[str, bool, tuple[type, ...], float, float, str]
"""A number field: its name, whether it may be null, types, minimum, maximum and description."""


def _numbers_of(kind: type[Any]) -> list[_Check]:
    """Return the checks of a message's number fields."""
    return [(one.name, *one.metadata["check"]) for one in fields(kind) if one.metadata]


_DRIVE, _MODE, _PING = _numbers_of(DriveMessage), _numbers_of(ModeMessage), _numbers_of(Ping)
_RELEASE = _numbers_of(ReleaseMessage)
_MODES, _BARE = [*Mode], [*BareMessage]


def _read(numbers: list[_Check], message: dict[str, Any], seq: int | None) -> dict[str, Any]:
    found, get = {}, message.get
    for name, is_optional, types, least, most, wanted in numbers:
        value: Any = get(name)
        if value is None and is_optional:
            continue
        if type(value) not in types or not least <= value <= most:
            raise _bad_field(name, wanted, seq)
        found[name] = value
    return found


def _check_point(numbers: dict[str, Any], may_be: bool, seq: int | None) -> None:
    for name, other in (("steering", "throttle"), ("throttle", "steering")):
        if name in numbers and not may_be:
            raise _bad_field(name, "absent unless a move is held and the robot accepts points", seq)
        if name in numbers and other not in numbers:
            raise _bad_field(other, f"a number when {name} is given", seq)


def _bad_field(name: str, wanted: str, seq: int | None) -> ProtocolError:
    return ProtocolError(ErrorCode.BAD_FIELD, f"{name!r} must be {wanted}", seq)


def encode_picture(frame: Frame, nonce: int = 0, *, is_quiet: bool = False) -> bytes:
    header = FRAME_HEADER.pack(
        _FRAME,
        _ENCODINGS.index(frame.encoding),
        frame.width,
        frame.height,
        _QUIET if is_quiet else 0,
        frame.frame_id,
        nonce,
        frame.captured_s * 1000,
    )
    return header + frame.data


def parse_picture(message: bytes) -> VideoFrame:
    if len(message) < FRAME_HEADER.size:
        raise ProtocolError(ErrorCode.MALFORMED, "a frame must begin with a header of 24 bytes")
    kind, encoding, width, height, flags, frame_id, nonce, captured_ms = FRAME_HEADER.unpack_from(
        message
    )
    if kind != _FRAME or encoding >= len(_ENCODINGS):
        raise ProtocolError(ErrorCode.UNKNOWN_TYPE, "unknown kind or encoding of a frame")
    return VideoFrame(
        frame_id=frame_id,
        captured_s=captured_ms / 1000,
        encoding=_ENCODINGS[encoding],
        width=width,
        height=height,
        data=message[FRAME_HEADER.size :],
        quiet=bool(flags & _QUIET),
        nonce=nonce,
    )


def encode_acknowledgement(frame_id: int) -> bytes:
    return ACKNOWLEDGEMENT.pack(_ACKNOWLEDGEMENT, 0, 0, frame_id)


def parse_acknowledgement(message: bytes) -> int:
    """Return the number of the frame that a client has drawn."""
    if (size := len(message)) != ACKNOWLEDGEMENT.size:
        code = ErrorCode.TOO_LARGE if size > ACKNOWLEDGEMENT.size else ErrorCode.MALFORMED
        raise ProtocolError(code, "an acknowledgement must have 8 bytes")
    kind, _, _, frame_id = ACKNOWLEDGEMENT.unpack(message)
    if kind != _ACKNOWLEDGEMENT:
        raise ProtocolError(ErrorCode.UNKNOWN_TYPE, "only acknowledgements are accepted here")
    return int(frame_id)


def encode_message(kind: str, **fields: Any) -> str:
    """Encode one message for the page: `hello`, `state`, `pong` or `event`."""
    return _ENCODER.encode({"type": kind, **fields})


_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)


def encode_error(error: ProtocolError) -> str:
    seq = {} if error.seq is None else {"seq": error.seq}
    return encode_message("error", code=error.code.value, message=str(error), **seq)
