"""Reads MCAP files that may be truncated, damaged or malicious.

Impossible lengths are rejected before memory is allocated for them, chunks are unpacked within
bounds, and reading stops at the first invalid record. All records before the first invalid one are
valid, so a truncated recording is readable to its end. Layout: mcap.dev/spec. The library `mcap`
trusts lengths and does not detect truncated files, so it is used only to parse the content of
single records.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.errors import RecordingError, need, told_as

MAX_RECORD_BYTES = 256 * 2**20
"""Largest record that is read, in bytes. Drivelesson itself never writes a larger record."""
MAX_CHUNK_BYTES = 64 * 2**20
"""Largest unpacked size of a chunk, in bytes."""
MAGIC = b"\x89MCAP0\r\n"
CUT_SHORT = "the file was cut short"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX = 2, 3, 4, 5, 6, 7
_CHUNK_INDEX, _ATTACHMENT, _ATTACHMENT_INDEX, _METADATA, _METADATA_INDEX = 8, 9, 10, 12, 13
_SUMMARY_OFFSET, _DATA_END = 14, 15
_HEAD = struct.Struct("<BQ")
_END = struct.Struct("<BQQQI8s")
"""The layout of a file's last bytes: the footer record, and then `MAGIC`. The footer's third value
is the offset of the summary."""
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_BUFFER_BYTES = 4096
_MOST_SUMMARY_BYTES = 16 * 2**20


Place = tuple[int, int, int]
_ROW = np.dtype(
    [
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_ns", "<u8"),
        ("start", "<u4"),
        ("stop", "<u4"),
    ]
)


class Schema(NamedTuple):
    """The format of a channel's messages."""

    name: str
    encoding: str
    data: bytes


class MessageChannel(NamedTuple):
    """Properties of all messages of a channel; `metadata` maps names to values."""

    topic: str
    encoding: str
    schema: Schema
    metadata: tuple[tuple[str, str], ...] = ()


class Message(NamedTuple):
    """One message. `place` contains the offset of its chunk, and where in this chunk the message's
    data begins and ends."""

    channel: MessageChannel
    log_ns: int
    sequence: int
    data: bytes
    place: Place

    @property
    def topic(self) -> str:
        return self.channel.topic


class Block(NamedTuple):
    """The messages of one chunk: its offset, its unpacked bytes, and a row for each message.

    A row has `channel`, `sequence`, `log_ns`, and the message's beginning and end in `data`.
    """

    offset: int
    channels: Mapping[int, MessageChannel]
    data: bytes
    rows: NDArray[np.void]

    def of(self, topic: str) -> NDArray[np.void]:
        """Return the rows of one topic, in the order of the file."""
        numbers = [number for number, channel in self.channels.items() if channel.topic == topic]
        if not numbers:
            return self.rows[:0]
        named = self.rows["channel"]
        is_own = named == numbers[0] if len(numbers) == 1 else np.isin(named, numbers)
        own: NDArray[np.void] = self.rows[is_own]
        return own

    def texts(self, rows: NDArray[np.void]) -> list[bytes]:
        """Return the data of these rows."""
        data, places = self.data, zip(rows["start"].tolist(), rows["stop"].tolist(), strict=True)
        return [data[start:stop] for start, stop in places]


class Metadata(NamedTuple):
    """A metadata record."""

    name: str
    values: dict[str, str]


class Attachment(NamedTuple):
    """An attached file."""

    name: str
    data: bytes


class Attached(NamedTuple):
    """An attachment that was found through a file's summary, with its offset."""

    offset: int
    name: str
    data: bytes


class Ends(NamedTuple):
    """The parts of a complete file that can be read without reading its chunks."""

    metadata: dict[str, dict[str, str]]
    channels: Mapping[int, MessageChannel]
    attachments: dict[str, bytes]
    sections: list[Attached]


class Cut(NamedTuple):
    """Stands for the unreadable rest of a damaged file. `reason` tells the user why the rest cannot
    be read.

    `lost_bytes` is the number of bytes after the last complete record of a truncated file; None if
    the file is damaged in another way.
    """

    reason: str
    lost_bytes: int | None = None


class CutError(RecordingError):
    """The file ends in the middle of a record."""


Record = Message | Metadata | Attachment | Cut
Part = Block | Metadata | Attachment | Cut


def require_mcap() -> None:
    """Raise MissingExtraError if the library that records and reads episodes is not installed."""
    need("mcap.writer", "recording episodes", "episodes")


def scan(path: Path) -> Iterator[Record]:
    """Yield the content of an MCAP file in order. If the file is incomplete, a `Cut` comes last."""
    return records_in(walk(path))


def records_in(parts: Iterable[Part]) -> Iterator[Record]:
    """Yield the messages of each chunk one by one, and all other content unchanged."""
    for part in parts:
        if not isinstance(part, Block):
            yield part
            continue
        offset, channels, data, rows = part
        for channel, sequence, log_ns, start, stop in rows.tolist():
            place = (offset, start, stop)
            yield Message(channels[channel], log_ns, sequence, data[start:stop], place)


def walk(path: Path) -> Iterator[Part]:
    """Yield the content like `scan`, but chunk by chunk, without an object for each message."""
    require_mcap()
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{path.name} is not an MCAP file")
        content = _Content()
        try:
            yield from content.parts(file)
        except CutError as error:
            lost_bytes = os.fstat(file.fileno()).st_size - content.end
            yield Cut(reason=str(error), lost_bytes=lost_bytes)
        except (RecordingError, ValueError, KeyError, MemoryError, struct.error) as error:
            yield Cut(reason=str(error) or type(error).__name__)


def blocks_from(path: Path, offset: int, channels: Mapping[int, MessageChannel]) -> Iterator[Block]:
    """Yield the chunks from `offset` on, up to the first unreadable chunk. `channels` are the
    channels that `walk` found."""
    with path.open("rb") as file:
        file.seek(offset)
        content = _Content(channels)
        try:
            yield from (part for part in content.parts(file) if isinstance(part, Block))
        except (RecordingError, ValueError, KeyError, MemoryError, struct.error):
            return


def has_end(path: Path) -> bool:
    """True if a file is complete: it is not being written, and was not truncated."""
    with path.open("rb") as file:
        file.seek(-min(file.seek(0, os.SEEK_END), len(MAGIC)), os.SEEK_END)
        return file.read() == MAGIC


def read_chunk(path: Path, offset: int) -> bytes:
    """Return the unpacked bytes of the chunk at `offset`. A `Place` contains the position of a
    message in these bytes."""
    with path.open("rb") as file:
        file.seek(offset)
        _, opcode, body = next(_records(file))
        if opcode != _CHUNK:
            raise RecordingError(f"{path.name} has no pictures at byte {offset}")
        return _unpacked(body)


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the metadata listed in a complete file's summary, by name, with a few short reads."""
    with path.open("rb", buffering=_BUFFER_BYTES) as file:
        return metadata_of(file)


def metadata_of(file: BinaryIO) -> dict[str, dict[str, str]]:
    """Return the metadata that are listed in the summary of an open, complete file, by name."""
    indexes = [body for kind, body in _summary(file) if kind == _METADATA_INDEX]
    return _metadata_at(file, [int.from_bytes(body[:8], "little") for body in indexes])


def read_ends(path: Path, sections: str, attachments: Sequence[str]) -> Ends:
    """Read a complete file's metadata, its channels, and the attachments with these names, but not
    its chunks. Raises RecordingError if the file has no summary."""
    require_mcap()
    content, places, attached = _Content(), [], []
    with path.open("rb") as file:
        for kind, body in _summary(file):
            if kind in (_SCHEMA, _CHANNEL):
                for _ in content.read(kind, body):
                    pass
            elif kind == _METADATA_INDEX:
                places.append(int.from_bytes(body[:8], "little"))
            elif kind == _ATTACHMENT_INDEX:
                record = _parse("AttachmentIndex", body)
                if record.name in (sections, *attachments):
                    attached.append(_attachment_at(file, record.offset))
        return Ends(
            metadata=_metadata_at(file, places),
            channels=content.channels,
            attachments={one.name: one.data for one in attached if one.name != sections},
            sections=[one for one in attached if one.name == sections],
        )


def _attachment_at(file: BinaryIO, offset: int) -> Attached:
    here = file.tell()
    file.seek(offset)
    _, opcode, body = next(_records(file))
    file.seek(here)
    if opcode != _ATTACHMENT:
        raise RecordingError("the summary gives a wrong position for an attachment")
    record = _parse("Attachment", body)
    return Attached(offset, record.name, record.data)


def _summary(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Yield the kind and body of each record of the summary. The chunk index, which grows with the
    file, is skipped if its position is in the summary."""
    end_at = file.seek(0, os.SEEK_END) - _END.size
    file.seek(max(end_at, 0))
    end = file.read()
    if len(end) < _END.size or end[-len(MAGIC) :] != MAGIC or end[0] != _FOOTER:
        raise RecordingError("the file's end is missing")
    _, _, start, offsets_at, _, _ = _END.unpack(end)
    chunks_at, after = _chunk_group(file, offsets_at, end_at)
    if not 0 < start < end_at <= start + _MOST_SUMMARY_BYTES + after - chunks_at:
        raise RecordingError("the file has no summary")
    file.seek(start)
    for offset, kind, body in _records(file):
        if offset == chunks_at:
            file.seek(after)
            continue
        yield kind, body


def _chunk_group(file: BinaryIO, offsets_at: int, end_at: int) -> tuple[int, int]:
    """Return where the chunk index begins and ends; 0 and 0 if the summary does not say."""
    if 0 < offsets_at < end_at:
        file.seek(offsets_at)
        for _, kind, body in _records(file, _MOST_SUMMARY_BYTES):
            if kind == _SUMMARY_OFFSET and len(body) == 17 and body[0] == _CHUNK_INDEX:
                begin, length = struct.unpack_from("<QQ", body, 1)
                if begin > 0 and length > 0 and begin + length <= offsets_at:
                    return begin, begin + length
    return 0, 0


def _metadata_at(file: BinaryIO, places: Sequence[int]) -> dict[str, dict[str, str]]:
    size, found = file.seek(0, os.SEEK_END), {}
    for place in places:
        file.seek(min(place, size))
        _, opcode, body = next(_records(file, _MOST_SUMMARY_BYTES))
        if opcode != _METADATA:
            raise RecordingError("the summary gives a wrong position for the metadata")
        record = _parse("Metadata", body)
        found[record.name] = record.metadata
    return found


class WrittenFile:
    """Reads the chunks of a file while it is written."""

    def __init__(self) -> None:
        self._content = _Content()

    @property
    def channels(self) -> Mapping[int, MessageChannel]:
        """The channels read so far, by number."""
        return self._content.channels

    def blocks(self, data: bytes, offset: int) -> Iterator[Block]:
        """Yield the chunks among the complete records in `data`, which were written at `offset`."""
        with contextlib.suppress(CutError):  # the last record may not be written completely yet
            for part in self._content.parts(io.BytesIO(data)):
                if isinstance(part, Block):
                    yield part._replace(offset=offset + part.offset)


def _records(
    file: BinaryIO, most_bytes: int = MAX_RECORD_BYTES
) -> Iterator[tuple[int, int, bytes]]:
    """Yield each record's offset, opcode and body, up to the footer."""
    start = file.tell()
    size = file.seek(0, os.SEEK_END)
    file.seek(start)
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
    """Parse a record with the class named `kind` of the library `mcap`."""
    from mcap import records
    from mcap.data_stream import ReadDataStream

    try:
        return getattr(records, kind).read(ReadDataStream(io.BytesIO(body)))
    except Exception as error:  # errors of the library or its dependencies
        reason = str(error) or "it is shorter than its header says"
        raise RecordingError(f"a record is damaged: {reason}") from error


class _Content:
    """The content of a file, with the `channels` read so far; `end` is the end of the last complete
    record."""

    def __init__(self, channels: Mapping[int, MessageChannel] | None = None) -> None:
        self.end = len(MAGIC)
        self._schemas = {0: Schema("", "", b"")}
        self.channels = dict(channels or {})

    def parts(self, file: BinaryIO) -> Iterator[Part]:
        """Yield the content up to the summary, which only repeats earlier content."""
        chunk: tuple[int, bytes] | None = None
        indexes: list[bytes] = []
        has_all = False
        records = _records(file)
        while True:
            try:
                record = next(records, None)
            except CutError:
                if chunk is not None:
                    yield from self._block(*chunk, indexes)
                raise
            if record is not None and record[1] == _MESSAGE_INDEX and chunk is not None:
                indexes.append(record[2])
                self.end = file.tell()
                continue
            if chunk is not None:
                yield from self._block(*chunk, indexes)
                chunk, indexes = None, []
            if record is None:
                return
            offset, opcode, body = record
            has_all = has_all or opcode == _DATA_END
            if opcode == _CHUNK and not has_all:
                chunk = offset, body
            elif not has_all:
                yield from self.read(opcode, body)
            self.end = file.tell()

    def _block(self, offset: int, body: bytes, indexes: list[bytes]) -> Iterator[Block]:
        data = _unpacked(body)
        places, trouble = _indexed(data, indexes), None
        if places is None:
            places, trouble = self._walked(data)
        rows = _rows(data, places)
        for number in set(rows["channel"].tolist()):
            if number not in self.channels:
                raise RecordingError("a message belongs to an unknown channel")
        yield Block(offset, self.channels, data, rows)
        if trouble is not None:
            raise trouble

    def _walked(self, data: bytes) -> tuple[NDArray[np.int64], RecordingError | None]:
        """Walk through a chunk's records; return the position of each message, and the first error
        if any."""
        places: list[tuple[int, int]] = []
        at, size, trouble = 0, len(data), None
        while at < size:
            stop = size + 1
            if at + _HEAD.size <= size:
                opcode, length = _HEAD.unpack_from(data, at)
                at += _HEAD.size
                stop = at + length
            if stop > size:
                trouble = RecordingError("a record is longer than its chunk")
                break
            if opcode == _MESSAGE:
                places.append((at, stop))
            else:
                for _ in self.read(opcode, data[at:stop]):
                    pass
            at = stop
        return np.array(places, np.int64).reshape(-1, 2), trouble

    def read(self, opcode: int, body: bytes) -> Iterator[Metadata | Attachment]:
        if opcode == _SCHEMA:
            record = _parse("Schema", body)
            self._schemas[record.id] = Schema(record.name, record.encoding, record.data)
        elif opcode == _CHANNEL:
            record = _parse("Channel", body)
            schema = self._schemas.get(record.schema_id, self._schemas[0])
            self.channels[record.id] = MessageChannel(
                record.topic, record.message_encoding, schema, tuple(record.metadata.items())
            )
        elif opcode == _METADATA:
            record = _parse("Metadata", body)
            yield Metadata(record.name, record.metadata)
        elif opcode == _ATTACHMENT:
            record = _parse("Attachment", body)
            yield Attachment(record.name, record.data)


def _indexed(data: bytes, indexes: Sequence[bytes]) -> NDArray[np.int64] | None:
    """Return where each message begins and ends, from the chunk's index. Return None if the index
    does not cover the whole chunk."""
    if not indexes or any(len(body) % 16 != 6 for body in indexes):
        return None
    parts = [np.frombuffer(body, "<u8", offset=6)[1::2] for body in indexes]
    at = np.sort(np.concatenate(parts))
    size = len(data)
    if not at.size or at[-1] > size - _HEAD.size - _MESSAGE_HEAD.size:
        return None
    places = at.astype(np.int64)
    raw = np.frombuffer(data, np.uint8)
    lengths = _gather(raw, places + 1, 8).view("<u8")[:, 0]
    if (lengths > size).any() or (raw[places] != _MESSAGE).any():
        return None
    starts = places + _HEAD.size
    stops = starts + lengths.astype(np.int64)
    is_whole = places[0] == 0 and stops[-1] == size and (stops[:-1] == places[1:]).all()
    return np.stack((starts, stops), axis=1) if is_whole else None


def _rows(data: bytes, places: NDArray[np.int64]) -> NDArray[np.void]:
    """Read the headers of messages."""
    rows = np.zeros(len(places), _ROW)
    if not len(places):
        return rows
    if (places[:, 1] - places[:, 0] < _MESSAGE_HEAD.size).any():
        raise RecordingError("a message is shorter than its header")
    heads = _gather(np.frombuffer(data, np.uint8), places[:, 0], _MESSAGE_HEAD.size)
    rows["channel"] = heads[:, :2].copy().view("<u2")[:, 0]
    rows["sequence"] = heads[:, 2:6].copy().view("<u4")[:, 0]
    rows["log_ns"] = heads[:, 6:14].copy().view("<u8")[:, 0]
    rows["start"] = places[:, 0] + _MESSAGE_HEAD.size
    rows["stop"] = places[:, 1]
    return rows


def _gather(raw: NDArray[np.uint8], at: NDArray[np.int64], count: int) -> NDArray[np.uint8]:
    """Return `count` bytes from each position, shape (positions, count)."""
    found: NDArray[np.uint8] = raw[at[:, None] + np.arange(count)]
    return found


def _unpacked(body: bytes) -> bytes:
    """Return a chunk's records, unpacked within bounds and verified by their checksum."""
    chunk = _parse("Chunk", body)
    size, checksum = chunk.uncompressed_size, chunk.uncompressed_crc
    if size > MAX_CHUNK_BYTES:
        raise RecordingError(f"a chunk of {size} unpacked bytes is too large")
    data = _unpack(chunk.compression, chunk.data, size)
    if len(data) != size:
        raise RecordingError("a chunk's unpacked size differs from its declared size")
    if checksum and zlib.crc32(data) != checksum:
        raise RecordingError("a chunk is damaged: its checksum does not match")
    return data


def _unpack(compression: str, data: bytes, size: int) -> bytes:
    """Unpack a chunk up to one byte beyond its declared size, to detect a wrong size."""
    # Each library raises different errors; all of them mean that the chunk is damaged.
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
