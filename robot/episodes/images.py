"""Pictures as Foxglove's own messages, in protobuf: the camera's bytes go in and out untouched.

The two messages are written down in https://github.com/foxglove/foxglove-sdk (schemas/proto).
Protobuf's wire format is small enough to write by hand, and a recording robot then needs no
protobuf library: https://protobuf.dev/programming-guides/encoding/.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from robot.errors import RecordingError
from robot.types import Encoding, Frame

COMPRESSED = "foxglove.CompressedImage"
RAW = "foxglove.RawImage"
_RAW_ENCODINGS = {Encoding.RGB: "rgb8", Encoding.YUYV: "yuv422_yuy2"}
_BYTES_A_PIXEL = {Encoding.RGB: 3, Encoding.YUYV: 2}
_BACK = {text: encoding for encoding, text in _RAW_ENCODINGS.items()}

# Field types of descriptor.proto.
_INT64, _INT32, _FIXED32, _STRING, _MESSAGE, _BYTES = 3, 5, 7, 9, 11, 12
_VARINT, _FIXED64_WIRE, _LENGTH, _FIXED32_WIRE = 0, 1, 2, 5
_CAMERA = "camera"


def schema_name(frame: Frame) -> str:
    """Return the name of the message that carries this frame."""
    return COMPRESSED if frame.encoding is Encoding.JPEG else RAW


def encode_image(frame: Frame, stamp_ns: int) -> bytes:
    """Return the frame as a message; `stamp_ns` is nanoseconds since 1970."""
    stamp = _field_message(
        1, _varint_field(1, stamp_ns // 10**9) + _varint_field(2, stamp_ns % 10**9)
    )
    if frame.encoding is Encoding.JPEG:
        rest = _field_bytes(4, _CAMERA.encode()) + _field_bytes(3, b"jpeg")
        return b"".join((stamp, rest, _head(2, len(frame.data)), frame.data))
    rest = b"".join(
        (
            _field_bytes(7, _CAMERA.encode()),
            _fixed32_field(2, frame.width),
            _fixed32_field(3, frame.height),
            _field_bytes(4, _RAW_ENCODINGS[frame.encoding].encode()),
            _fixed32_field(5, frame.width * _BYTES_A_PIXEL[frame.encoding]),
        )
    )
    return b"".join((stamp, rest, _head(6, len(frame.data)), frame.data))


def decode_image(
    name: str, message: bytes, *, frame_id: int, captured_s: float, size: tuple[int, int]
) -> Frame:
    """Read a frame back.

    Args:
        name: The schema's name.
        message: The bytes.
        frame_id: Its key, which the message does not carry.
        captured_s: When it was taken, on the run's clock.
        size: Width and height of a JPEG, which its message does not carry.

    Raises:
        RecordingError: If the message is none of the two, or damaged.
    """
    fields: dict[int, Any] = dict(_fields(message))
    try:
        if name == COMPRESSED:
            encoding, (width, height), data = Encoding.JPEG, size, fields[2]
        elif name == RAW:
            encoding = _BACK[bytes(fields[4]).decode()]
            width, height, data = fields[2], fields[3], fields[6]
        else:
            raise RecordingError(f"no picture: {name}")
    except (KeyError, UnicodeDecodeError, TypeError) as error:
        raise RecordingError(f"frame {frame_id} is damaged: {error}") from error
    return Frame(
        frame_id=frame_id,
        captured_s=captured_s,
        width=int(width),
        height=int(height),
        encoding=encoding,
        data=bytes(data),
    )


def image_schema(name: str) -> bytes:
    """Return the message's description as a FileDescriptorSet, as MCAP asks for it."""
    fields = {
        COMPRESSED: (
            (1, "timestamp", _MESSAGE),
            (4, "frame_id", _STRING),
            (2, "data", _BYTES),
            (3, "format", _STRING),
        ),
        RAW: (
            (1, "timestamp", _MESSAGE),
            (7, "frame_id", _STRING),
            (2, "width", _FIXED32),
            (3, "height", _FIXED32),
            (4, "encoding", _STRING),
            (5, "step", _FIXED32),
            (6, "data", _BYTES),
        ),
    }[name]
    time_path = "google/protobuf/timestamp.proto"
    time = _file(
        time_path, "google.protobuf", "Timestamp", ((1, "seconds", _INT64), (2, "nanos", _INT32))
    )
    package, _, message = name.partition(".")
    image = _file(f"{package}/{message}.proto", package, message, fields, depends_on=time_path)
    return _field_message(1, time) + _field_message(1, image)


def _file(
    path: str,
    package: str,
    message: str,
    fields: tuple[tuple[int, str, int], ...],
    depends_on: str | None = None,
) -> bytes:
    """Return a FileDescriptorProto of one message."""
    described = _field_bytes(1, message.encode())
    for number, name, kind in fields:
        described += _field_message(2, _described_field(number, name, kind))
    parts = [_field_bytes(1, path.encode()), _field_bytes(2, package.encode())]
    if depends_on:
        parts.append(_field_bytes(3, depends_on.encode()))
    return b"".join((*parts, _field_message(4, described), _field_bytes(12, b"proto3")))


def _described_field(number: int, name: str, kind: int) -> bytes:
    """Return a FieldDescriptorProto; the only message-typed field there is, is a Timestamp."""
    described = _field_bytes(1, name.encode()) + _varint_field(3, number) + _varint_field(4, 1)
    described += _varint_field(5, kind)
    return described + (_field_bytes(6, b".google.protobuf.Timestamp") if kind == _MESSAGE else b"")


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def _varint_field(number: int, value: int) -> bytes:
    return _varint(number << 3 | _VARINT) + _varint(value)


def _fixed32_field(number: int, value: int) -> bytes:
    return _varint(number << 3 | _FIXED32_WIRE) + struct.pack("<I", value)


def _head(number: int, length: int) -> bytes:
    return _varint(number << 3 | _LENGTH) + _varint(length)


def _field_bytes(number: int, data: bytes) -> bytes:
    return _head(number, len(data)) + data


_field_message = _field_bytes


def _fields(message: bytes) -> Iterator[tuple[int, int | memoryview]]:
    """Yield number and value of each field. Raises RecordingError where the bytes end early."""
    view, at = memoryview(message), 0
    while at < len(view):
        key, at = _read_varint(view, at)
        number, wire = key >> 3, key & 7
        if wire == _VARINT:
            value, at = _read_varint(view, at)
            yield number, value
            continue
        length = {_FIXED64_WIRE: 8, _FIXED32_WIRE: 4}.get(wire)
        if wire == _LENGTH:
            length, at = _read_varint(view, at)
        if length is None or at + length > len(view):
            raise RecordingError("a picture's message is damaged")
        data = view[at : at + length]
        at += length
        yield number, data if wire == _LENGTH else int.from_bytes(data, "little")


def _read_varint(view: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while at < len(view) and shift < 64:
        byte = view[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
    raise RecordingError("a picture's message is damaged")
