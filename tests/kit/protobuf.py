"""Reads protobuf messages by the schema in their own file, like a viewer."""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, unknown_fields


def read_protobuf(name: str, schema: bytes, data: bytes) -> Any:
    """Return a message; fail if it has a field that its schema lacks."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
    message = kind.FromString(data)
    assert len(unknown_fields.UnknownFieldSet(message)) == 0
    return message
