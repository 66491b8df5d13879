"""Pictures as Foxglove's protobuf messages; the camera's bytes stay unchanged.

The two messages are defined in https://github.com/foxglove/foxglove-sdk (schemas/proto).
protobuf is imported when the first picture comes, because an EV3 never records.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from robot.errors import RecordingError, told_as
from robot.recordings.messages import Topic
from robot.recordings.reader import MessageChannel, Place, Schema
from robot.types import Encoding, Frame

COMPRESSED = "foxglove.CompressedImage"
RAW = "foxglove.RawImage"
_RAW_ENCODINGS = {Encoding.RGB: "rgb8", Encoding.YUYV: "yuv422_yuy2"}
_BYTES_A_PIXEL = {Encoding.RGB: 3, Encoding.YUYV: 2}
_BACK = {text: encoding for encoding, text in _RAW_ENCODINGS.items()}
_CAMERA = "camera"
_FIELDS = {
    COMPRESSED: (
        (1, "timestamp", "TYPE_MESSAGE"),
        (4, "frame_id", "TYPE_STRING"),
        (2, "data", "TYPE_BYTES"),
        (3, "format", "TYPE_STRING"),
    ),
    RAW: (
        (1, "timestamp", "TYPE_MESSAGE"),
        (7, "frame_id", "TYPE_STRING"),
        (2, "width", "TYPE_FIXED32"),
        (3, "height", "TYPE_FIXED32"),
        (4, "encoding", "TYPE_STRING"),
        (5, "step", "TYPE_FIXED32"),
        (6, "data", "TYPE_BYTES"),
    ),
}


def camera_channel(frame: Frame) -> MessageChannel:
    size = (("width", str(frame.width)), ("height", str(frame.height)))
    return MessageChannel(Topic.CAMERA, "protobuf", _schema(_name_of(frame)), size)


def _name_of(frame: Frame) -> str:
    return COMPRESSED if frame.encoding is Encoding.JPEG else RAW


def encode_image(frame: Frame, stamp_ns: int) -> bytes:
    """Return the frame as a message; `stamp_ns` is nanoseconds since 1970."""
    image = _message_type(_name_of(frame))(frame_id=_CAMERA, data=frame.data)
    image.timestamp.seconds, image.timestamp.nanos = divmod(stamp_ns, 10**9)
    if frame.encoding is Encoding.JPEG:
        image.format = "jpeg"
    else:
        image.width, image.height = frame.width, frame.height
        image.encoding = _RAW_ENCODINGS[frame.encoding]
        image.step = frame.width * _BYTES_A_PIXEL[frame.encoding]
    data: bytes = image.SerializeToString()
    return data


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameEntry:
    """The position of a picture in the file, and its time in seconds of the run's clock.

    The picture's id, and the width and height of a JPEG, are not in the message itself.
    """

    frame_id: int
    captured_s: float
    schema: str
    size: tuple[int, int]
    place: Place


def decode_image(entry: FrameEntry, message: bytes) -> Frame:
    name = entry.schema
    if name not in _FIELDS:
        raise RecordingError(f"not an image message: {name}")
    from google.protobuf.message import DecodeError

    damaged = f"frame {entry.frame_id} is damaged"
    with told_as(RecordingError, damaged, DecodeError, KeyError, UnicodeDecodeError):
        image = _message_type(name).FromString(bytes(message))
        encoding = Encoding.JPEG if name == COMPRESSED else _BACK[image.encoding]
    if not image.data:
        raise RecordingError(f"{damaged}: it contains no picture")
    width, height = entry.size if name == COMPRESSED else (image.width, image.height)
    return Frame(
        frame_id=entry.frame_id,
        captured_s=entry.captured_s,
        width=int(width),
        height=int(height),
        encoding=encoding,
        data=image.data,
    )


@cache
def _schema(name: str) -> Schema:
    return Schema(name, "protobuf", _descriptors(name).SerializeToString())


def _descriptors(name: str) -> Any:
    """Describe a message and its imports as the FileDescriptorSet that MCAP requires."""
    from google.protobuf import descriptor_pb2, timestamp_pb2

    package, _, message = name.partition(".")
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{package}/{message}.proto",
        package=package,
        syntax="proto3",
        dependency=[timestamp_pb2.DESCRIPTOR.name],
    )
    described = file.message_type.add(name=message)
    for number, field, kind in _FIELDS[name]:
        described.field.add(
            number=number,
            name=field,
            type=descriptor_pb2.FieldDescriptorProto.Type.Value(kind),
            label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
            type_name=".google.protobuf.Timestamp" if kind == "TYPE_MESSAGE" else None,
        )
    imported = descriptor_pb2.FileDescriptorProto.FromString(timestamp_pb2.DESCRIPTOR.serialized_pb)
    return descriptor_pb2.FileDescriptorSet(file=[imported, file])


@cache
def _message_type(name: str) -> Any:
    """Return protobuf's class for one of the two messages, from a separate descriptor pool."""
    from google.protobuf import descriptor_pool, message_factory

    pool = descriptor_pool.DescriptorPool()
    for file in _descriptors(name).file:
        pool.AddSerializedFile(file.SerializeToString())
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
