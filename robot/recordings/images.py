"""Pictures as Foxglove's messages; the camera's bytes stay unchanged."""

from __future__ import annotations

from dataclasses import dataclass

from robot.errors import RecordingError, told_as
from robot.recordings.foxglove import (
    COMPRESSED_IMAGE,
    RAW_IMAGE,
    message_type,
    schema_of,
)
from robot.recordings.messages import Topic
from robot.recordings.reader import MessageChannel, Place
from robot.types import Encoding, Frame

_RAW_ENCODINGS = {Encoding.RGB: "rgb8", Encoding.YUYV: "yuv422_yuy2"}
_BYTES_A_PIXEL = {Encoding.RGB: 3, Encoding.YUYV: 2}
_BACK = {text: encoding for encoding, text in _RAW_ENCODINGS.items()}
_CAMERA = "camera"


def camera_channel(frame: Frame) -> MessageChannel:
    size = (("width", str(frame.width)), ("height", str(frame.height)))
    return MessageChannel(Topic.CAMERA, "protobuf", schema_of(_name_of(frame)), size)


def _name_of(frame: Frame) -> str:
    return COMPRESSED_IMAGE if frame.encoding is Encoding.JPEG else RAW_IMAGE


def encode_image(frame: Frame, stamp_ns: int) -> bytes:
    """Return the frame as a message; `stamp_ns` is its time in nanoseconds since 1970."""
    image = message_type(_name_of(frame))(frame_id=_CAMERA, data=frame.data)
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
    if name not in (COMPRESSED_IMAGE, RAW_IMAGE):
        raise RecordingError(f"not an image message: {name}")
    from google.protobuf.message import DecodeError

    damaged = f"frame {entry.frame_id} is damaged"
    with told_as(RecordingError, damaged, DecodeError, KeyError, UnicodeDecodeError):
        image = message_type(name).FromString(bytes(message))
        encoding = Encoding.JPEG if name == COMPRESSED_IMAGE else _BACK[image.encoding]
    if not image.data:
        raise RecordingError(f"{damaged}: it contains no picture")
    width, height = entry.size if name == COMPRESSED_IMAGE else (image.width, image.height)
    return Frame(
        frame_id=entry.frame_id,
        captured_s=entry.captured_s,
        width=int(width),
        height=int(height),
        encoding=encoding,
        data=image.data,
    )
