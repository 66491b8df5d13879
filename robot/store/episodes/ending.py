"""Gives a recording that was cut short the end that it lacks, once, at the next start.

Nothing that is in it is moved or written again: what the cut left of the last record goes, and
summary and index follow. A file that is damaged in another way is left as it is.
"""

from __future__ import annotations

import json
import logging
import os
import struct
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from robot.errors import RecordingError
from robot.store.episodes.messages import CAMERA, LESSON
from robot.store.episodes.reader import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    DATA_END,
    FOOTER,
    HEAD,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    METADATA,
    METADATA_INDEX,
    SCHEMA,
    Body,
    CutError,
    parts,
    records,
)
from robot.store.episodes.summary import note_event
from robot.store.episodes.writer import RUN, SUMMARY

log = logging.getLogger(__name__)

_STATISTICS, _CHUNK_INDEX = 11, 8
_MOST_LOST_BYTES = 16 * 2**20
"""A cut takes part of one record; whoever seems to have lost more is damaged in another way."""
_UNUSABLE = (RecordingError, ValueError, KeyError, TypeError, RecursionError)


def end_cut_recordings(folder: Path) -> None:
    """End every recording of the folder that was cut short; never raises."""
    for path in sorted(folder.glob("*.mcap")):
        try:
            if end_recording(path):
                log.info("the recording %s was cut short; it has its end now", path.name)
        except OSError as error:
            log.warning("the recording %s stays cut short: %s", path.name, error)


def end_recording(path: Path) -> bool:
    """Give one recording its end if it was cut short; True if it was. Raises OSError."""
    if not path.is_file() or path.is_symlink():
        return False
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        if size < 2 * len(MAGIC) or file.read(len(MAGIC)) != MAGIC:
            return False
        file.seek(-len(MAGIC), os.SEEK_END)
        if file.read() == MAGIC:
            return False
        file.seek(len(MAGIC))
        contents = _Contents()
        try:
            for offset, opcode, body in records(file):
                if opcode in (DATA_END, FOOTER):  # the data are whole, their index was cut
                    contents.is_whole = True
                    break
                contents.note(offset, opcode, body)
        except CutError:
            pass
        except _UNUSABLE:
            return False
    if RUN not in contents.metadata or size - contents.end > _MOST_LOST_BYTES:
        return False
    with path.open("r+b") as file:
        file.truncate(contents.end)
        file.seek(contents.end)
        file.write(contents.closing())
        file.flush()
        os.fsync(file.fileno())
    return True


@dataclass(slots=True)
class _Contents:
    """What a recording holds up to its cut, for the index; `end` is where it is good up to."""

    end: int = len(MAGIC)
    is_whole: bool = False
    schemas: dict[int, bytes] = field(default_factory=dict)
    channels: dict[int, bytes] = field(default_factory=dict)
    topics: dict[int, str] = field(default_factory=dict)
    chunks: list[_Chunk] = field(default_factory=list)
    metadata: dict[str, tuple[int, int]] = field(default_factory=dict)
    attachments: int = 0
    messages: Counter[int] = field(default_factory=Counter)
    frames: set[int] = field(default_factory=set)
    labels: dict[int, str] = field(default_factory=dict)
    times_ns: tuple[int, int] | None = None

    def note(self, offset: int, opcode: int, body: Body) -> None:
        end = offset + HEAD.size + len(body.data)
        if opcode == CHUNK:
            for kind, part in parts(body):
                self._note_part(kind, part)
            self.chunks.append(_Chunk(offset, end, body.data))
        elif opcode == MESSAGE_INDEX:
            self.chunks[-1].indexes[body.number(2)] = offset
            self.chunks[-1].indexed = end
        elif opcode == METADATA:
            self.metadata[body.text()] = offset, end - offset
        elif opcode == ATTACHMENT:
            self.attachments += 1
        else:
            self._note_part(opcode, body)
        self.end = end

    def _note_part(self, opcode: int, body: Body) -> None:
        if opcode == SCHEMA:
            self.schemas[body.number(2)] = body.data
        elif opcode == CHANNEL:
            number, _, topic = body.number(2), body.number(2), body.text()
            self.channels[number], self.topics[number] = body.data, topic
        elif opcode == MESSAGE:
            number, sequence, log_ns = body.number(2), body.number(4), body.number(8)
            self.messages[number] += 1
            first_ns, last_ns = self.times_ns or (log_ns, log_ns)
            self.times_ns = min(first_ns, log_ns), max(last_ns, log_ns)
            if self.topics[number] == CAMERA:
                self.frames.add(sequence)
            elif self.topics[number] == LESSON:
                note_event(self.labels, body.rest(8))

    def closing(self) -> bytes:
        """Return what belongs behind the last good record."""
        data = b""
        if not self.is_whole:  # a summary that is there already was written before the last chunk
            data = _record(METADATA, _text(SUMMARY) + _map(self._summary()))
            self.metadata[SUMMARY] = self.end, len(data)
        data += _record(DATA_END, struct.pack("<I", 0))
        index = b"".join(_record(SCHEMA, body) for body in self.schemas.values())
        index += b"".join(_record(CHANNEL, body) for body in self.channels.values())
        index += _record(_STATISTICS, self._statistics())
        index += b"".join(chunk.index() for chunk in self.chunks)
        index += b"".join(
            _record(METADATA_INDEX, struct.pack("<QQ", *place) + _text(name))
            for name, place in self.metadata.items()
        )
        footer = struct.pack("<QQI", self.end + len(data), 0, 0)
        return data + index + _record(FOOTER, footer) + MAGIC

    def _summary(self) -> dict[str, str]:
        first_ns, last_ns = self.times_ns or (0, 0)
        return {
            "frames": str(len(self.frames)),
            "taught": json.dumps(Counter(self.labels.values())),
            "duration_s": f"{(last_ns - first_ns) / 1e9:.3f}",
            "damage": CutError.sentence,
        }

    def _statistics(self) -> bytes:
        counts = b"".join(struct.pack("<HQ", *item) for item in self.messages.items())
        things = len(self.schemas), len(self.channels), self.attachments
        head = struct.pack(
            "<QHIIII", self.messages.total(), *things, len(self.metadata), len(self.chunks)
        )
        return head + struct.pack("<QQI", *(self.times_ns or (0, 0)), len(counts)) + counts


@dataclass(slots=True)
class _Chunk:
    offset: int
    end: int
    data: bytes
    indexes: dict[int, int] = field(default_factory=dict)
    indexed: int = 0

    def __post_init__(self) -> None:
        """Keep what the index says of it, and none of its pictures."""
        body = Body(self.data)
        times, size, _ = body.take(16), body.take(8), body.take(4)
        compression = _text(body.text())
        self.data = times + compression + body.take(8) + size

    def index(self) -> bytes:
        places = b"".join(struct.pack("<HQ", *item) for item in self.indexes.items())
        where = struct.pack("<QQI", self.offset, self.end - self.offset, len(places)) + places
        length = struct.pack("<Q", max(self.indexed - self.end, 0))
        return _record(_CHUNK_INDEX, self.data[:16] + where + length + self.data[16:])


def _record(opcode: int, body: bytes) -> bytes:
    return HEAD.pack(opcode, len(body)) + body


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text.encode())) + text.encode()


def _map(values: dict[str, str]) -> bytes:
    data = b"".join(_text(key) + _text(value) for key, value in values.items())
    return struct.pack("<I", len(data)) + data
