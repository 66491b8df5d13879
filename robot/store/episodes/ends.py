"""The metadata of a whole MCAP file, from two short reads of its ends.

A list of two thousand recordings opens two thousand files, so each may cost a tenth of a
millisecond. The library makes objects of all that a summary section holds; only the places of the
metadata records are wanted here. Layout: mcap.dev/spec, "Footer", "Metadata Index", "Metadata".
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from robot.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"
METADATA, _METADATA_INDEX, _FOOTER = 0x0C, 0x0D, 0x02
RECORD = struct.Struct("<BQ")
_FOOTER_BODY = struct.Struct("<QQI")
_INDEX_BODY = struct.Struct("<QQ")
_LENGTH = struct.Struct("<I")
_END_BYTES = RECORD.size + _FOOTER_BODY.size + len(MAGIC)
_HEAD_BYTES, _TAIL_BYTES = 4096, 32768
"""Read at once: enough for what a run says of itself, and for the end of some minutes' drive."""
_MOST_BYTES = 16 * 2**20
"""A summary section or a metadata record that claims to be larger is not read."""


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the metadata records that the file's summary lists, by name.

    Raises:
        RecordingError: If the file is not whole, or its end makes no sense.
        OSError: If it cannot be read.
    """
    with path.open("rb", buffering=0) as file:
        try:
            ends = _Ends(file)
            return dict(ends.metadata(*place) for place in ends.places())
        except (struct.error, UnicodeDecodeError) as error:
            raise RecordingError(f"{path.name} has no summary: {error}") from error


class _Ends:
    """The first and the last bytes of a file, read once; other bytes are read when asked for."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = os.fstat(file.fileno()).st_size
        self._head = file.read(_HEAD_BYTES)
        self._tail_at = max(0, self._size - _TAIL_BYTES)
        self._tail = self._at(self._tail_at, _TAIL_BYTES)

    def _at(self, offset: int, length: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(length)

    def bytes(self, offset: int, length: int) -> bytes:
        """Return exactly these bytes of the file."""
        if length > _MOST_BYTES or offset + length > self._size:
            raise RecordingError("a length that cannot be")
        if offset + length <= len(self._head):
            return self._head[offset : offset + length]
        if offset >= self._tail_at:
            return self._tail[offset - self._tail_at :][:length]
        data = self._at(offset, length)
        if len(data) != length:
            raise RecordingError("the file was cut short")
        return data

    def places(self) -> Iterator[tuple[int, int]]:
        """Yield offset and length of each metadata record, as the summary section lists them."""
        end = self.bytes(max(0, self._size - _END_BYTES), min(self._size, _END_BYTES))
        opcode, length = RECORD.unpack_from(end)
        if end[-len(MAGIC) :] != MAGIC or (opcode, length) != (_FOOTER, _FOOTER_BODY.size):
            raise RecordingError("the file's end is missing")
        start, _, _ = _FOOTER_BODY.unpack_from(end, RECORD.size)
        summary_bytes = self._size - _END_BYTES - start
        if start == 0 or summary_bytes <= 0:
            raise RecordingError("the file has no summary")
        summary, at = self.bytes(start, summary_bytes), 0
        while at < len(summary):
            opcode, length = RECORD.unpack_from(summary, at)
            at += RECORD.size
            if opcode == _METADATA_INDEX:
                yield _INDEX_BODY.unpack_from(summary, at)
            at += length

    def metadata(self, offset: int, length: int) -> tuple[str, dict[str, str]]:
        """Return name and values of the metadata record at a place."""
        record = self.bytes(offset, length)
        opcode, body_bytes = RECORD.unpack_from(record)
        if opcode != METADATA or body_bytes != length - RECORD.size:
            raise RecordingError("no metadata where the summary says")
        return parse_metadata(record[RECORD.size :])


def parse_metadata(body: bytes) -> tuple[str, dict[str, str]]:
    """Return name and values of a metadata record.

    Raises:
        RecordingError, struct.error, UnicodeDecodeError: If it is none.
    """
    name, at = read_text(body, 0)
    (map_bytes,) = _LENGTH.unpack_from(body, at)
    at += _LENGTH.size
    end = at + map_bytes
    if end > len(body):
        raise RecordingError("a map that is longer than its record")
    values: dict[str, str] = {}
    while at < end:
        key, at = read_text(body, at)
        values[key], at = read_text(body, at)
    return name, values


def read_text(record: bytes, at: int) -> tuple[str, int]:
    """Return the text that begins at `at`, and where it ends."""
    (length,) = _LENGTH.unpack_from(record, at)
    end = at + _LENGTH.size + length
    if end > len(record):
        raise RecordingError("a text that is longer than its record")
    return record[at + _LENGTH.size : end].decode(), end
