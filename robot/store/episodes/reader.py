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
from typing import Any, BinaryIO

from robot.errors import MissingExtraError, RecordingError

MAX_RECORD_BYTES = 256 * 2**20
"""Attachments hold models, chunks hold pictures; nothing of ours is larger."""
MAX_CHUNK_BYTES = 64 * 2**20
"""What one chunk may unpack to."""
MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 1, 2, 3, 4, 5, 6
MESSAGE_INDEX, ATTACHMENT, METADATA, METADATA_INDEX, DATA_END = 7, 9, 12, 13, 15
HEAD = struct.Struct("<BQ")
_END_BYTES = HEAD.size + 20 + len(MAGIC)
_FIRST_BYTES, _LAST_BYTES = 4096, 32768
"""Read at once: enough for what a run says of itself, and for the end of some minutes' drive."""
_MOST_SUMMARY_BYTES = 16 * 2**20


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


class CutError(RecordingError):
    """The file ends in the middle of a record."""

    sentence = "the file was cut short"

    def __init__(self) -> None:
        super().__init__(self.sentence)


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
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{path.name} is not an MCAP file")
        channels = _Channels()
        try:
            for offset, opcode, body in records(file):
                yield from channels.read(offset, opcode, body)
        except (RecordingError, ValueError, KeyError, MemoryError) as error:
            yield Cut(reason=str(error) or type(error).__name__)


def read_chunk(path: Path, offset: int) -> list[bytes]:
    """Return the messages' data of the chunk that begins at `offset`, in order.

    Raises:
        RecordingError: If there is none.
    """
    with path.open("rb") as file:
        file.seek(offset)
        _, opcode, body = next(records(file))
        if opcode != CHUNK:
            raise RecordingError(f"{path.name} has no pictures at {offset}")
        return [part.rest(22) for kind, part in parts(body) if kind == MESSAGE]


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the metadata that a whole file's summary lists, by name, from two short reads.

    Raises:
        RecordingError: If the file is not whole, or its end makes no sense.
        OSError: If it cannot be read.
    """
    with path.open("rb", buffering=0) as file:
        try:
            ends = _Ends(file)
            return dict(ends.metadata(*place) for place in ends.places())
        except UnicodeDecodeError as error:
            raise RecordingError(f"{path.name} has no summary: {error}") from error


def records(file: BinaryIO) -> Iterator[tuple[int, int, Body]]:
    """Yield each record's place, opcode and body, up to the footer."""
    size = os.fstat(file.fileno()).st_size
    while True:
        offset = file.tell()
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            raise CutError
        opcode, length = HEAD.unpack(head)
        if opcode == 0 or length > MAX_RECORD_BYTES or length > size - file.tell():
            raise CutError
        yield offset, opcode, Body(file.read(length))
        if opcode == FOOTER:
            if file.read(len(MAGIC)) != MAGIC:
                raise RecordingError("the file's end is missing")
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
        """Take so many bytes."""
        at, self.at = self.at, self.at + length
        if length < 0 or self.at > len(self.data):
            raise RecordingError("a record that is longer than what holds it")
        return self.data[at : self.at]

    def number(self, length: int) -> int:
        """Take a number of so many bytes."""
        return int.from_bytes(self.take(length), "little")

    def text(self) -> str:
        """Take a text."""
        return self.take(self.number(4)).decode()

    def map(self) -> dict[str, str]:
        """Take texts by name."""
        inside, values = Body(self.take(self.number(4))), {}
        while inside.at < len(inside.data):
            key = inside.text()
            values[key] = inside.text()
        return values


def _metadata(body: Body) -> tuple[str, dict[str, str]]:
    return body.text(), body.map()


@dataclass(slots=True)
class _Channels:
    """What the file has said of its channels so far."""

    schemas: dict[int, str] = field(default_factory=dict)
    channels: dict[int, dict[str, Any]] = field(default_factory=dict)

    def read(self, offset: int, opcode: int, body: Body) -> Iterator[Record]:
        if opcode == CHUNK:
            index = 0
            for kind, part in parts(body):
                if kind == MESSAGE:
                    channel, sequence, log_ns = part.number(2), part.number(4), part.number(8)
                    yield Message(
                        **self.channels[channel],
                        log_ns=log_ns,
                        sequence=sequence,
                        data=part.rest(8),
                        place=(offset, index),
                    )
                    index += 1
                else:
                    self._note(kind, part)
        elif opcode == METADATA:
            name, values = _metadata(body)
            yield Metadata(name=name, values=values)
        elif opcode == ATTACHMENT:
            body.take(16)
            name, _ = body.text(), body.text()
            yield Attachment(name=name, data=body.take(body.number(8)))
        else:
            self._note(opcode, body)

    def _note(self, opcode: int, body: Body) -> None:
        if opcode == SCHEMA:
            number, name, _ = body.number(2), body.text(), body.text()
            body.take(body.number(4))
            self.schemas[number] = name
        elif opcode == CHANNEL:
            number, schema, topic, _ = body.number(2), body.number(2), body.text(), body.text()
            self.channels[number] = {
                "topic": topic,
                "schema": self.schemas.get(schema, ""),
                "channel_metadata": body.map(),
            }
        elif opcode == HEADER:
            body.text(), body.text()


def parts(chunk: Body) -> Iterator[tuple[int, Body]]:
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


class _Ends:
    """The first and the last bytes of a file, read once; other bytes are read when asked for."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = os.fstat(file.fileno()).st_size
        self._first = file.read(_FIRST_BYTES)
        self._last_at = max(0, self._size - _LAST_BYTES)
        self._last = self._read(self._last_at, _LAST_BYTES)

    def _read(self, offset: int, length: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(length)

    def bytes(self, offset: int, length: int) -> Body:
        """Return exactly these bytes of the file."""
        if length > _MOST_SUMMARY_BYTES or offset + length > self._size:
            raise RecordingError("a length that cannot be")
        if offset + length <= len(self._first):
            return Body(self._first[offset : offset + length])
        if offset >= self._last_at:
            return Body(self._last[offset - self._last_at :][:length])
        return Body(self._read(offset, length))

    def places(self) -> Iterator[tuple[int, int]]:
        """Yield offset and length of each metadata record, as the summary section lists them."""
        if self._size < _END_BYTES:
            raise RecordingError("the file's end is missing")
        end = self.bytes(self._size - _END_BYTES, _END_BYTES)
        opcode, length, start = end.number(1), end.number(8), end.number(8)
        if end.data[-len(MAGIC) :] != MAGIC or (opcode, length) != (FOOTER, 20):
            raise RecordingError("the file's end is missing")
        summary_bytes = self._size - _END_BYTES - start
        if start == 0 or summary_bytes <= 0:
            raise RecordingError("the file has no summary")
        summary = self.bytes(start, summary_bytes)
        while summary.at < summary_bytes:
            opcode = summary.number(1)
            body = Body(summary.take(summary.number(8)))
            if opcode == METADATA_INDEX:
                yield body.number(8), body.number(8)

    def metadata(self, offset: int, length: int) -> tuple[str, dict[str, str]]:
        """Return name and values of the metadata record at a place."""
        record = self.bytes(offset, length)
        if record.number(1) != METADATA or record.number(8) != length - HEAD.size:
            raise RecordingError("no metadata where the summary says")
        return _metadata(record)
