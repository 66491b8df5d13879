"""Reading MCAP files that may be cut short, damaged or made to harm.

Impossible lengths are rejected before anything is set aside for them, chunks are unpacked within
bounds, and reading stops at the first record that does not make sense. All before it is good: an
episode is readable up to where its file was cut. Layout: mcap.dev/spec. The library `mcap` is not
asked: it believes lengths, and a list of two thousand recordings opens two thousand files.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from robot.errors import RecordingError, need

MAX_RECORD_BYTES = 256 * 2**20
"""Attachments hold models, chunks hold pictures; nothing of ours is larger."""
MAX_CHUNK_BYTES = 64 * 2**20
"""What one chunk may unpack to."""
MAGIC = b"\x89MCAP0\r\n"
CUT_SHORT = "the file was cut short"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 2, 3, 4, 5, 6
_ATTACHMENT, _METADATA, _METADATA_INDEX, _DATA_END = 9, 12, 13, 15
_HEAD = struct.Struct("<BQ")
_END_BYTES = _HEAD.size + 20 + len(MAGIC)
_BUFFER_BYTES = 4096
_MOST_SUMMARY_BYTES = 16 * 2**20


@dataclass(frozen=True, slots=True)
class Schema:
    """What the messages of a channel look like."""

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True)
class MessageChannel:
    """What all messages of a channel have in common; the metadata are names and values."""

    topic: str
    encoding: str
    schema: Schema
    metadata: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """One message. `place` finds it again: chunk and index."""

    channel: MessageChannel
    log_ns: int
    sequence: int
    data: bytes
    place: tuple[int, int]

    @property
    def topic(self) -> str:
        return self.channel.topic


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
    """The file ends here although it is not at its end; the reason is for a person.

    `lost_bytes` stand behind the last whole record of a file that was cut short; None if it is
    damaged in another way. `has_all` is True if nothing but its summary was cut.
    """

    reason: str
    lost_bytes: int | None = None
    has_all: bool = False


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
        channels, end, has_all = _Channels(), file.tell(), False
        try:
            for offset, opcode, body in _records(file):
                has_all = has_all or opcode == _DATA_END
                if not has_all:  # what follows repeats some of it
                    yield from channels.read(offset, opcode, body)
                end = file.tell()
        except CutError as error:
            lost_bytes = os.fstat(file.fileno()).st_size - end
            yield Cut(reason=str(error), lost_bytes=lost_bytes, has_all=has_all)
        except (RecordingError, ValueError, KeyError, MemoryError) as error:
            yield Cut(reason=str(error) or type(error).__name__)


def read_chunk(path: Path, offset: int) -> list[bytes]:
    """Return the messages' data of the chunk that begins at `offset`, in order."""
    with path.open("rb") as file:
        file.seek(offset)
        _, opcode, body = next(_records(file))
        if opcode != _CHUNK:
            raise RecordingError(f"{path.name} has no pictures at {offset}")
        return [part.rest(22) for kind, part in _parts(body) if kind == _MESSAGE]


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the metadata that a whole file's summary lists, by name, from a few short reads."""
    with path.open("rb", buffering=_BUFFER_BYTES) as file:
        return metadata_of(file)


def metadata_of(file: BinaryIO) -> dict[str, dict[str, str]]:
    """Do as `read_metadata`, with a file that is open."""
    end_at = file.seek(0, os.SEEK_END) - _END_BYTES
    file.seek(max(end_at, 0))
    end = Body(file.read())
    opcode, length, start = end.number(1), end.number(8), end.number(8)
    if end.data[-len(MAGIC) :] != MAGIC or (opcode, length) != (_FOOTER, 20):
        raise RecordingError("the file's end is missing")
    if not 0 < start < end_at <= start + _MOST_SUMMARY_BYTES:
        raise RecordingError("the file has no summary")
    file.seek(start)
    places = [body.number(8) for _, kind, body in _records(file) if kind == _METADATA_INDEX]
    found = {}
    for place in places:
        file.seek(min(place, end_at))
        _, opcode, body = next(_records(file, _MOST_SUMMARY_BYTES))
        if opcode != _METADATA:
            raise RecordingError("no metadata where the summary says")
        try:
            name = body.text()
            found[name] = body.map()
        except UnicodeDecodeError as error:
            raise RecordingError("metadata that are no text") from error
    return found


def _records(file: BinaryIO, most_bytes: int = MAX_RECORD_BYTES) -> Iterator[tuple[int, int, Body]]:
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
        yield offset, opcode, Body(file.read(length))
        if opcode == _FOOTER:
            if file.read(len(MAGIC)) != MAGIC:
                raise CutError(CUT_SHORT)
            return


class Body:
    """The bytes of a record, taken from the front; more than there are raises RecordingError."""

    __slots__ = ("at", "data")

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def rest(self, skip: int = 0) -> bytes:
        """Take all that is left, but for the first bytes of it."""
        self.at += skip
        return self.take(len(self.data) - self.at)

    def take(self, length: int) -> bytes:
        at, self.at = self.at, self.at + length
        if length < 0 or self.at > len(self.data):
            raise RecordingError("a record that is longer than what holds it")
        return self.data[at : self.at]

    def number(self, length: int) -> int:
        return int.from_bytes(self.take(length), "little")

    def text(self) -> str:
        return self.take(self.number(4)).decode()

    def map(self) -> dict[str, str]:
        inside, values = Body(self.take(self.number(4))), {}
        while inside.at < len(inside.data):
            key = inside.text()
            values[key] = inside.text()
        return values


@dataclass(slots=True)
class _Channels:
    """What the file has said of its channels so far."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, MessageChannel] = field(default_factory=dict)

    def read(self, offset: int, opcode: int, body: Body) -> Iterator[Record]:
        if opcode == _CHUNK:
            index = 0
            for kind, part in _parts(body):
                if kind == _MESSAGE:
                    channel, sequence, log_ns = part.number(2), part.number(4), part.number(8)
                    yield Message(
                        channel=self.channels[channel],
                        log_ns=log_ns,
                        sequence=sequence,
                        data=part.rest(8),
                        place=(offset, index),
                    )
                    index += 1
                else:
                    self._note(kind, part)
        elif opcode == _METADATA:
            yield Metadata(name=body.text(), values=body.map())
        elif opcode == _ATTACHMENT:
            body.take(16)
            name, _ = body.text(), body.text()
            yield Attachment(name=name, data=body.take(body.number(8)))
        else:
            self._note(opcode, body)

    def _note(self, opcode: int, body: Body) -> None:
        if opcode == _SCHEMA:
            number, name, encoding = body.number(2), body.text(), body.text()
            self.schemas[number] = Schema(name, encoding, body.take(body.number(4)))
        elif opcode == _CHANNEL:
            number, schema = body.number(2), self.schemas.get(body.number(2), _NO_SCHEMA)
            topic, encoding = body.text(), body.text()
            self.channels[number] = MessageChannel(
                topic, encoding, schema, tuple(body.map().items())
            )


_NO_SCHEMA = Schema("", "", b"")


def _parts(chunk: Body) -> Iterator[tuple[int, Body]]:
    """Yield a chunk's records, unpacked within bounds and checked against their checksum."""
    chunk.take(16)
    size, checksum, compression = chunk.number(8), chunk.number(4), chunk.text()
    if size > MAX_CHUNK_BYTES:
        raise RecordingError(f"a chunk that claims to unpack to {size} bytes is refused")
    data = _unpack(compression, chunk.take(chunk.number(8)), size)
    if len(data) != size:
        raise RecordingError("a chunk unpacks to another size than it claims")
    if checksum and zlib.crc32(data) != checksum:
        raise RecordingError("a chunk is damaged: its checksum does not match")
    inside = Body(data)
    while inside.at < size:
        opcode = inside.number(1)
        yield opcode, Body(inside.take(inside.number(8)))


def _unpack(compression: str, data: bytes, size: int) -> bytes:
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
