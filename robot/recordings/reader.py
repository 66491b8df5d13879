"""Reading MCAP files that may be cut short, damaged or made to harm.

Impossible lengths are rejected before anything is set aside for them, chunks are unpacked within
bounds, and reading stops at the first record that does not make sense. All before it is good: an
episode is readable up to where its file was cut. Layout: mcap.dev/spec. The library `mcap` is not
asked for more than what stands within a record: it believes lengths, and takes a file that was cut
short for a whole one.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from robot.errors import RecordingError, need, told_as

MAX_RECORD_BYTES = 256 * 2**20
"""Attachments hold models, chunks hold pictures; nothing of ours is larger."""
MAX_CHUNK_BYTES = 64 * 2**20
"""What one chunk may unpack to."""
MAGIC = b"\x89MCAP0\r\n"
CUT_SHORT = "the file was cut short"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 2, 3, 4, 5, 6
_ATTACHMENT, _METADATA, _METADATA_INDEX, _DATA_END = 9, 12, 13, 15
_HEAD = struct.Struct("<BQ")
_END = struct.Struct("<BQQQI8s")
"""The end of a file: its footer, whose third value is where the summary begins, and `MAGIC`."""
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_BUFFER_BYTES = 4096
_MOST_SUMMARY_BYTES = 16 * 2**20


class Schema(NamedTuple):
    """What the messages of a channel look like."""

    name: str
    encoding: str
    data: bytes


class MessageChannel(NamedTuple):
    """What all messages of a channel have in common; the metadata are names and values."""

    topic: str
    encoding: str
    schema: Schema
    metadata: tuple[tuple[str, str], ...] = ()


class Message(NamedTuple):
    """One message. `place` finds it again: chunk and index."""

    channel: MessageChannel
    log_ns: int
    sequence: int
    data: bytes
    place: tuple[int, int]

    @property
    def topic(self) -> str:
        return self.channel.topic


class Metadata(NamedTuple):
    """A metadata record."""

    name: str
    values: dict[str, str]


class Attachment(NamedTuple):
    """An attached file."""

    name: str
    data: bytes


class Cut(NamedTuple):
    """The file ends here although it is not at its end; the reason is for a person.

    `lost_bytes` stand behind the last whole record of a file that was cut short; None if it is
    damaged in another way.
    """

    reason: str
    lost_bytes: int | None = None


class CutError(RecordingError):
    """The file ends in the middle of a record."""


Record = Message | Metadata | Attachment | Cut


def require_mcap() -> None:
    """Raise MissingExtraError unless episodes can be recorded and read here."""
    need("mcap.writer", "recording episodes", "episodes")


def scan(path: Path) -> Iterator[Record]:
    """Yield what an MCAP file holds, in its order; a `Cut` comes last if the file is not whole."""
    require_mcap()
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{path.name} is not an MCAP file")
        content, end, has_all = _Content(), file.tell(), False
        try:
            for offset, opcode, body in _records(file):
                has_all = has_all or opcode == _DATA_END
                if not has_all:  # what follows repeats some of it
                    yield from content.read(offset, opcode, body)
                end = file.tell()
        except CutError as error:
            lost_bytes = os.fstat(file.fileno()).st_size - end
            yield Cut(reason=str(error), lost_bytes=lost_bytes)
        except (RecordingError, ValueError, KeyError, MemoryError, struct.error) as error:
            yield Cut(reason=str(error) or type(error).__name__)


def has_end(path: Path) -> bool:
    """True unless a file is being written, or was cut short."""
    with path.open("rb") as file:
        file.seek(-min(file.seek(0, os.SEEK_END), len(MAGIC)), os.SEEK_END)
        return file.read() == MAGIC


def read_chunk(path: Path, offset: int) -> list[bytes]:
    """Return the messages' data of the chunk that begins at `offset`, in order."""
    with path.open("rb") as file:
        file.seek(offset)
        _, opcode, body = next(_records(file))
        if opcode != _CHUNK:
            raise RecordingError(f"{path.name} has no pictures at {offset}")
        return [part[_MESSAGE_HEAD.size :] for kind, part in _parts(body) if kind == _MESSAGE]


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the metadata that a whole file's summary lists, by name, from a few short reads."""
    with path.open("rb", buffering=_BUFFER_BYTES) as file:
        return metadata_of(file)


def metadata_of(file: BinaryIO) -> dict[str, dict[str, str]]:
    """Do as `read_metadata`, with a file that is open."""
    end_at = file.seek(0, os.SEEK_END) - _END.size
    file.seek(max(end_at, 0))
    end = file.read()
    if len(end) < _END.size or end[-len(MAGIC) :] != MAGIC or end[0] != _FOOTER:
        raise RecordingError("the file's end is missing")
    start = _END.unpack(end)[2]
    if not 0 < start < end_at <= start + _MOST_SUMMARY_BYTES:
        raise RecordingError("the file has no summary")
    file.seek(start)
    indexes = [body for _, kind, body in _records(file) if kind == _METADATA_INDEX]
    found = {}
    for place in (int.from_bytes(body[:8], "little") for body in indexes):
        file.seek(min(place, end_at))
        _, opcode, body = next(_records(file, _MOST_SUMMARY_BYTES))
        if opcode != _METADATA:
            raise RecordingError("no metadata where the summary says")
        record = _parse("Metadata", body)
        found[record.name] = record.metadata
    return found


def _records(
    file: BinaryIO, most_bytes: int = MAX_RECORD_BYTES
) -> Iterator[tuple[int, int, bytes]]:
    """Yield each record's place, opcode and body, up to the footer."""
    size = os.fstat(file.fileno()).st_size
    while True:
        offset = file.tell()
        head = file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            raise CutError(CUT_SHORT)
        opcode, length = _HEAD.unpack(head)
        if opcode == 0 or length > most_bytes or length > size - file.tell():
            raise CutError(CUT_SHORT)
        yield offset, opcode, file.read(length)
        if opcode == _FOOTER:
            if file.read(len(MAGIC)) != MAGIC:
                raise CutError(CUT_SHORT)
            return


def _parse(kind: str, body: bytes) -> Any:
    """Return a record of the library's class of this name."""
    from mcap import records
    from mcap.data_stream import ReadDataStream

    try:
        return getattr(records, kind).read(ReadDataStream(io.BytesIO(body)))
    except Exception as error:  # the library's, and those of what it reads by
        reason = str(error) or "it is shorter than it says"
        raise RecordingError(f"a record is damaged: {reason}") from error


class _Content:
    """What the file holds, and what it has said of its channels so far."""

    def __init__(self) -> None:
        self._schemas = {0: Schema("", "", b"")}
        self._channels: dict[int, MessageChannel] = {}

    def read(self, offset: int, opcode: int, body: bytes) -> Iterator[Record]:
        index = 0
        for kind, part in _parts(body) if opcode == _CHUNK else [(opcode, body)]:
            if kind == _MESSAGE and opcode == _CHUNK:
                channel, sequence, log_ns, _ = _MESSAGE_HEAD.unpack_from(part)
                data = part[_MESSAGE_HEAD.size :]
                yield Message(self._channels[channel], log_ns, sequence, data, (offset, index))
                index += 1
            elif kind == _SCHEMA:
                record = _parse("Schema", part)
                self._schemas[record.id] = Schema(record.name, record.encoding, record.data)
            elif kind == _CHANNEL:
                record = _parse("Channel", part)
                schema = self._schemas.get(record.schema_id, self._schemas[0])
                self._channels[record.id] = MessageChannel(
                    record.topic, record.message_encoding, schema, tuple(record.metadata.items())
                )
            elif kind == _METADATA:
                record = _parse("Metadata", part)
                yield Metadata(record.name, record.metadata)
            elif kind == _ATTACHMENT:
                record = _parse("Attachment", part)
                yield Attachment(record.name, record.data)


def _parts(body: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield a chunk's records, unpacked within bounds and checked against their checksum."""
    chunk = _parse("Chunk", body)
    size, checksum = chunk.uncompressed_size, chunk.uncompressed_crc
    if size > MAX_CHUNK_BYTES:
        raise RecordingError(f"a chunk that claims to unpack to {size} bytes is refused")
    data = _unpack(chunk.compression, chunk.data, size)
    if len(data) != size:
        raise RecordingError("a chunk unpacks to another size than it claims")
    if checksum and zlib.crc32(data) != checksum:
        raise RecordingError("a chunk is damaged: its checksum does not match")
    at = 0
    while at < size:
        opcode, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size + length
        if at > size:
            raise RecordingError("a record that is longer than what holds it")
        yield opcode, data[at - length : at]


def _unpack(compression: str, data: bytes, size: int) -> bytes:
    """Unpack to at most one byte more than was claimed, whatever the data holds."""
    # Each library has errors of its own; all mean the same here.
    with told_as(RecordingError, "a chunk cannot be unpacked", Exception):
        if compression == "zstd":
            import zstandard

            with zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)) as reader:
                return reader.read(size + 1)
        if compression == "lz4":
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    if compression:
        raise RecordingError(f"unknown compression of a chunk: {compression[:20]!r}")
    return data
