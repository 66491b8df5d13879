"""Reading MCAP files that may be cut short, damaged or made to harm.

The library `mcap` parses the records; this module rejects impossible
lengths, unpacks chunks within bounds, and stops at the first record that does not make sense. All
before it is good: an episode is readable up to where its file was cut.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from robot.errors import MissingExtraError, RecordingError

MAX_RECORD_BYTES = 256 * 2**20
"""Attachments hold models, chunks hold pictures; nothing of ours is larger."""
MAX_CHUNK_BYTES = 64 * 2**20
"""What one chunk may unpack to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """One message with what its channel says of it. `place` finds it again: chunk and index."""

    topic: str
    schema: str
    channel_metadata: dict[str, str]
    log_ns: int
    sequence: int
    data: bytes
    place: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Metadata:
    """A metadata record."""

    name: str
    values: dict[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """An attached file."""

    name: str
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Cut:
    """The file ends here although it is not at its end; the reason is for a person."""

    reason: str


Record = Message | Metadata | Attachment | Cut


def require_mcap() -> None:
    """Raise MissingExtraError unless episodes can be recorded and read here."""
    try:
        import mcap.writer  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("recording episodes", "episodes") from error


def scan(path: Path) -> Iterator[Record]:
    """Yield what the file holds, in its order; a `Cut` comes last if the file is not whole.

    Raises:
        RecordingError: If it is not an MCAP file.
        MissingExtraError: If the library `mcap` is not installed.
    """
    require_mcap()
    with path.open("rb") as file:
        yield from _scan(file, path)


def read_chunk(path: Path, offset: int) -> list[Any]:
    """Return the raw messages of the chunk that begins at `offset`, in order.

    Raises:
        RecordingError: If there is none.
    """
    from mcap.opcode import Opcode
    from mcap.records import Chunk

    with path.open("rb") as file:
        file.seek(offset)
        stream = _Bounded(file, path.stat().st_size - offset)
        head = stream.read(9)
        if head[0] != Opcode.CHUNK:
            raise RecordingError(f"{path.name} has no pictures at {offset}")
        chunk = Chunk.read(_data_stream(stream))
        return [r for r in _break_up(chunk) if type(r).__name__ == "Message"]


def _scan(file: BinaryIO, path: Path) -> Iterator[Record]:
    from mcap.exceptions import InvalidMagic, McapError
    from mcap.stream_reader import StreamReader

    stream = _Bounded(file, path.stat().st_size)
    reader = StreamReader(stream, emit_chunks=True, record_size_limit=MAX_RECORD_BYTES)
    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    has_begun = False
    try:
        for record in _with_offsets(reader, stream):
            has_begun = True
            offset, value = record
            yield from _read_record(value, offset, schemas, channels)
    except InvalidMagic as error:
        if not has_begun:
            raise RecordingError(f"{path.name} is not an MCAP file") from error
        yield Cut(reason="the file's end is missing")
    except struct.error as error:
        if not has_begun:
            raise RecordingError(f"{path.name} is not an MCAP file: it is too short") from error
        yield Cut(reason="the file was cut short")
    except (McapError, RecordingError, ValueError, KeyError, MemoryError, OverflowError) as error:
        yield Cut(reason=str(error) or type(error).__name__)


def _with_offsets(reader: Any, stream: _Bounded) -> Iterator[tuple[int, Any]]:
    """Pair each record with the place where it begins: the end of the one before."""
    records = iter(reader.records)
    offset = 8  # behind the magic bytes
    while True:
        try:
            record = next(records)
        except StopIteration:
            return
        yield offset, record
        offset = stream.position


def _read_record(
    value: Any, offset: int, schemas: dict[int, Any], channels: dict[int, Any]
) -> Iterator[Record]:
    kind = type(value).__name__
    if kind == "Chunk":
        yield from _read_chunk(value, offset, schemas, channels)
    elif kind == "Metadata":
        yield Metadata(name=value.name, values=dict(value.metadata))
    elif kind == "Attachment":
        yield Attachment(name=value.name, data=value.data)
    elif kind == "Schema":
        schemas[value.id] = value
    elif kind == "Channel":
        channels[value.id] = value


def _read_chunk(
    chunk: Any, offset: int, schemas: dict[int, Any], channels: dict[int, Any]
) -> Iterator[Message]:
    index = 0
    for record in _break_up(chunk):
        kind = type(record).__name__
        if kind == "Schema":
            schemas[record.id] = record
        elif kind == "Channel":
            channels[record.id] = record
        else:
            channel = channels[record.channel_id]
            schema = schemas.get(channel.schema_id)
            yield Message(
                topic=channel.topic,
                schema=schema.name if schema else "",
                channel_metadata=dict(channel.metadata),
                log_ns=record.log_time,
                sequence=record.sequence,
                data=record.data,
                place=(offset, index),
            )
            index += 1


def _break_up(chunk: Any) -> list[Any]:
    """Return a chunk's records, unpacked within bounds and checked against their checksum."""
    from dataclasses import replace

    from mcap.stream_reader import breakup_chunk

    if chunk.uncompressed_size > MAX_CHUNK_BYTES:
        raise RecordingError(
            f"a chunk that claims to unpack to {chunk.uncompressed_size} bytes is refused"
        )
    data = unpack(chunk.compression, chunk.data, chunk.uncompressed_size)
    if len(data) != chunk.uncompressed_size:
        raise RecordingError("a chunk unpacks to another size than it claims")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise RecordingError("a chunk is damaged: its checksum does not match")
    return list(breakup_chunk(replace(chunk, compression="", data=data)))


def unpack(compression: str, data: bytes, size: int) -> bytes:
    """Unpack to at most one byte more than was claimed, whatever the data holds."""
    try:
        if compression == "zstd":
            import zstandard

            with zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)) as reader:
                return reader.read(size + 1)
        if compression == "lz4":
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    except Exception as error:  # each library has errors of its own; all mean the same here
        raise RecordingError(f"a chunk cannot be unpacked: {error}") from error
    if compression:
        raise RecordingError(f"unknown compression of a chunk: {compression[:20]!r}")
    return data


def _data_stream(stream: _Bounded) -> Any:
    from mcap.data_stream import ReadDataStream

    return ReadDataStream(stream)


class _Bounded:
    """A file that refuses to read beyond its end, before anything is set aside for it."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size
        self.position = 0

    def read(self, length: int) -> bytes:
        if length > self._size - self.position:
            raise RecordingError("the file was cut short")
        data = self._file.read(length)
        self.position += len(data)
        return data
