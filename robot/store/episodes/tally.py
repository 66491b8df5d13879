"""What a recording that was cut short holds, counted in one pass and without keeping any of it.

Such a file has no summary, and a list must not take ten seconds and 200 MB for an hour's drive, as
opening it does. Only what a cut leaves is counted here: whole chunks with right checksums, and an
end in the middle of a record. All else is left to `open_episode`, which says what is wrong.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from robot.errors import RecordingError
from robot.store.episodes.ends import MAGIC, METADATA, RECORD, parse_metadata, read_text
from robot.store.episodes.messages import CAMERA, LESSON
from robot.store.episodes.scan import MAX_CHUNK_BYTES, MAX_RECORD_BYTES, unpack
from robot.store.episodes.writer import FORMAT, RUN

_CHANNEL, _MESSAGE, _CHUNK, _FOOTER = 0x04, 0x05, 0x06, 0x02
_CHANNEL_BODY = struct.Struct("<HH")
_MESSAGE_BODY = struct.Struct("<HIQ")
_MESSAGE_BYTES = 22
_CHUNK_BODY = struct.Struct("<QQQI")
_LENGTH = struct.Struct("<Q")
_CUT = "the file was cut short"


@dataclass(slots=True)
class Tally:
    """The sums of one recording. `run` is what it says of itself."""

    run: dict[str, str] = field(default_factory=dict)
    frames: set[int] = field(default_factory=set)
    labels: dict[int, str] = field(default_factory=dict)
    first_ns: int | None = None
    last_ns: int = 0
    damage: str = _CUT

    @property
    def taught(self) -> Counter[str]:
        """How many frames were taught each move, without those that were undone."""
        return Counter(self.labels.values())

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last message."""
        return 0.0 if self.first_ns is None else (self.last_ns - self.first_ns) / 1e9


def count_cut_recording(path: Path) -> Tally | None:
    """Count what a recording that was cut short holds; None if it is anything else.

    Raises:
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        try:
            return _count(file)
        except (RecordingError, struct.error, ValueError, KeyError, TypeError, AttributeError):
            return None


def _count(file: BinaryIO) -> Tally | None:
    tally, topics = Tally(), dict[int, str]()
    size = os.fstat(file.fileno()).st_size
    if file.read(len(MAGIC)) != MAGIC:
        return None
    while True:
        head = file.read(RECORD.size)
        if len(head) < RECORD.size:
            return tally if tally.run else None
        opcode, length = RECORD.unpack(head)
        if opcode == _FOOTER or length > MAX_RECORD_BYTES:
            return None
        if file.tell() + length > size:
            return tally if tally.run else None
        if opcode == METADATA:
            name, values = parse_metadata(file.read(length))
            if name == RUN:
                if int(values["format"]) > FORMAT:
                    return None
                tally.run = values
        elif opcode == _CHUNK and tally.run:
            _count_chunk(tally, topics, file.read(length))
        else:
            file.seek(length, os.SEEK_CUR)


def _count_chunk(tally: Tally, topics: dict[int, str], body: bytes) -> None:
    _, _, size, checksum = _CHUNK_BODY.unpack_from(body)
    if size > MAX_CHUNK_BYTES:
        raise RecordingError("a chunk that is too large")
    compression, at = read_text(body, _CHUNK_BODY.size)
    (packed_bytes,) = _LENGTH.unpack_from(body, at)
    at += _LENGTH.size
    data = unpack(compression, body[at : at + packed_bytes], size)
    if len(data) != size or (checksum and zlib.crc32(data) != checksum):
        raise RecordingError("a chunk is damaged")
    at = 0
    while at < size:
        opcode, length = RECORD.unpack_from(data, at)
        at += RECORD.size
        if opcode == _MESSAGE:
            channel, sequence, log_ns = _MESSAGE_BODY.unpack_from(data, at)
            topic = topics[channel]
            if topic == CAMERA:
                tally.frames.add(sequence)
            elif topic == LESSON:
                _note_event(tally.labels, json.loads(data[at + _MESSAGE_BYTES : at + length]))
            if tally.first_ns is None:
                tally.first_ns = log_ns
            tally.first_ns = min(tally.first_ns, log_ns)
            tally.last_ns = max(tally.last_ns, log_ns)
        elif opcode == _CHANNEL:
            channel, _ = _CHANNEL_BODY.unpack_from(data, at)
            topics[channel], _ = read_text(data, at + _CHANNEL_BODY.size)
        at += length
    if at != size:
        raise RecordingError("a record that is longer than its chunk")


def _note_event(labels: dict[int, str], plain: dict[str, object]) -> None:
    kind = plain["event"]
    if kind == "taught":
        labels[int(str(plain["frame"]))] = str(plain["label"])
    elif kind == "undone":
        for frame_id in list(plain["frames"]):  # type: ignore[call-overload]
            labels.pop(int(frame_id), None)
