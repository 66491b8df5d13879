"""Foxglove's protobuf messages that viewers draw: pictures and poses.

The messages are defined in https://github.com/foxglove/foxglove-sdk (schemas/proto). protobuf is
imported with the first message, so an EV3, which never records, never loads it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from robot.recordings.reader import Schema

COMPRESSED_IMAGE = "foxglove.CompressedImage"
RAW_IMAGE = "foxglove.RawImage"
POSE_IN_FRAME = "foxglove.PoseInFrame"
_VECTOR = "foxglove.Vector3"
_QUATERNION = "foxglove.Quaternion"
_POSE = "foxglove.Pose"
_TIMESTAMP = "google.protobuf.Timestamp"
_FIELDS: dict[str, dict[str, tuple[int, str]]] = {
    COMPRESSED_IMAGE: {
        "timestamp": (1, _TIMESTAMP),
        "frame_id": (4, "string"),
        "data": (2, "bytes"),
        "format": (3, "string"),
    },
    RAW_IMAGE: {
        "timestamp": (1, _TIMESTAMP),
        "frame_id": (7, "string"),
        "width": (2, "fixed32"),
        "height": (3, "fixed32"),
        "encoding": (4, "string"),
        "step": (5, "fixed32"),
        "data": (6, "bytes"),
    },
    _VECTOR: {name: (number, "double") for number, name in enumerate("xyz", start=1)},
    _QUATERNION: {name: (number, "double") for number, name in enumerate("xyzw", start=1)},
    _POSE: {"position": (1, _VECTOR), "orientation": (2, _QUATERNION)},
    POSE_IN_FRAME: {"timestamp": (1, _TIMESTAMP), "frame_id": (2, "string"), "pose": (3, _POSE)},
}
"""Number and type of each field, by message. If a type's name contains a dot, the type is a
message, too."""


@cache
def schema_of(name: str) -> Schema:
    """Return a message's schema as the FileDescriptorSet that MCAP requires, imports included."""
    from google.protobuf import descriptor_pb2

    files = descriptor_pb2.FileDescriptorSet(file=_files(name))
    return Schema(name, "protobuf", files.SerializeToString(deterministic=True))


@cache
def message_type(name: str) -> Any:
    """Return protobuf's class for a message, from a separate descriptor pool."""
    from google.protobuf import descriptor_pool, message_factory

    pool = descriptor_pool.DescriptorPool()
    for file in _files(name):
        pool.AddSerializedFile(file.SerializeToString())
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


def _files(name: str) -> list[Any]:
    """Return the files that a message imports, then a file that describes the message."""
    return list({file.name: file for file in _describe(name)}.values())


def _describe(name: str) -> Iterator[Any]:
    from google.protobuf import descriptor_pb2, timestamp_pb2

    if name == _TIMESTAMP:
        yield descriptor_pb2.FileDescriptorProto.FromString(timestamp_pb2.DESCRIPTOR.serialized_pb)
        return
    package, _, message = name.partition(".")
    kinds = descriptor_pb2.FieldDescriptorProto.Type
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{package}/{message}.proto", package=package, syntax="proto3"
    )
    described = file.message_type.add(name=message)
    for field, (number, kind) in _FIELDS[name].items():
        is_message = "." in kind
        described.field.add(
            number=number,
            name=field,
            type=kinds.Value("TYPE_MESSAGE" if is_message else f"TYPE_{kind.upper()}"),
            label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
            type_name=f".{kind}" if is_message else None,
        )
        if is_message:
            *imports, last = _files(kind)
            yield from imports
            yield last
            if last.name not in file.dependency:
                file.dependency.append(last.name)
    yield file
