"""The index of a recording: its columns, written as attachments while the recording is made.

A recording with an index is opened without reading its chunks. Each section (`SECTION_FRAMES`
pictures) has its own attachment, so the recorder holds the columns of only one section in memory. A
section contains its own position in the file and the position of the previous section. If another
program rewrites the file, the sections move, and no longer lie at the positions that they contain.
An index of moved sections is not used.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path

from robot.errors import RecordingError
from robot.policy.events import to_json
from robot.recordings.columns import FrameTable, LessonTable, Span, read_fields
from robot.recordings.messages import (
    MODEL_AFTER,
    MODEL_BEFORE,
    PART,
    RUN,
    SUMMARY,
    Fields,
    Topic,
)
from robot.recordings.reader import Attached, Block, Ends, MessageChannel, read_ends

INDEX = "drivelesson.index"
SECTION_FRAMES = 8192
"""Number of pictures in a section: about five minutes of driving, and 0.6 MB of columns."""
_FORMAT = 1
_MOST_RESULTS = 1000
"""Maximum number of extensions' results in the index. If there are more, only the newest are in the
index."""
_MOST_BYTES = 2**26
_HEAD = struct.Struct("<II")
"""The checksum of a section, and the length of its description."""
SPANNED = tuple(t for t in Topic if t not in (Topic.CAMERA, Topic.POSE))
"""The topics whose times determine the recording's duration. The topic of the sensors also contains
the pose."""


class Columns:
    """The columns of a recording, or of one section of it."""

    def __init__(self, origin_ns: int = 0) -> None:
        self.frames, self.lessons, self.span = FrameTable(origin_ns), LessonTable(), Span()
        self.pictures = 0
        """Number of pictures that were added, including duplicates."""
        self.results: list[tuple[int, Fields]] = []
        """The newest results of extensions, each with its time in nanoseconds since 1970."""

    def add(self, block: Block) -> None:
        """Add the messages of a chunk. Raises one of `UNREADABLE` if a message is damaged."""
        self.frames.add(block)
        self.pictures += len(block.of(Topic.CAMERA))
        rows = block.of(Topic.LESSON)
        times_s = ((rows["log_ns"].astype("<i8") - self.frames.origin_ns) / 1e9).tolist()
        self.span.add(block, SPANNED)
        self.lessons.add(times_s, block.texts(rows))
        rows = block.of(Topic.RESULT)
        told = read_fields(block.texts(rows))
        self.add_results(zip(rows["log_ns"].astype("<i8").tolist(), told, strict=True))

    def add_results(self, results: Iterable[tuple[int, Fields]]) -> None:
        for stamp_ns, fields in results:
            plain = {name: value for name, value in fields.items() if _is_plain(value)}
            self.results.append((int(stamp_ns), plain))
        del self.results[:-_MOST_RESULTS]

    def extend(self, later: Columns, base: int) -> None:
        """Add the columns of the recording's next file, which begins at the offset `base`."""
        self.frames.load(*later.frames.dump(), base)
        self.lessons.load(*later.lessons.dump())
        self.span.load(later.span.ends)
        self.pictures += later.pictures
        self.add_results(later.results)


def _is_plain(value: object) -> bool:
    """True for values that every export can write: a string, a bool or a finite number."""
    return isinstance(value, str | int) or (isinstance(value, float) and math.isfinite(value))


def encode(
    columns: Columns,
    channels: Mapping[int, MessageChannel],
    place: int,
    since: int,
    *,
    is_last: bool,
) -> bytes:
    """Return a section as bytes. `place` is the section's own offset in the file, and `since` is
    the offset of the previous section."""
    numbers = {channel: number for number, channel in channels.items()}
    frames, used = columns.frames.dump()
    lessons, about = columns.lessons.dump()
    description = to_json(
        {
            "format": _FORMAT,
            "place": place,
            "since": since,
            "is_last": is_last,
            "channels": [numbers[channel] for channel in used],
            "frames": len(frames),
            "lessons": about,
            "span": columns.span.ends,
            "results": columns.results,
        }
    )
    packed = zlib.compress(description + frames + lessons, 1)
    return _HEAD.pack(zlib.crc32(packed), len(description)) + packed


def frames_before(run: Mapping[str, str]) -> int:
    """Return the number of pictures that a recording has before one of its files begins. `run` is
    the metadata of that file."""
    return int(json.loads(run[PART])["frames"]) if PART in run else 0


def read_columns(path: Path) -> tuple[Ends, Columns] | None:
    """Read a complete recording's columns from its index; return None if there is no valid index.

    Raises RecordingError, or another of `UNREADABLE`, or OSError, if the index cannot be read.
    """
    ends = read_ends(path, INDEX, (MODEL_BEFORE, MODEL_AFTER))
    sections = sorted(ends.sections, key=lambda one: one.offset)
    if RUN not in ends.metadata or SUMMARY not in ends.metadata or not sections:
        return None
    columns, since = Columns(int(ends.metadata[RUN]["origin_ns"])), 0
    for section in sections:
        is_last = section is sections[-1]
        if not _load(columns, section, ends.channels, since, is_last=is_last):
            return None
        since = section.offset
    before = frames_before(ends.metadata[RUN])
    is_complete = len(columns.frames) + before == int(ends.metadata[SUMMARY]["frames"])
    return (ends, columns) if is_complete else None


def _load(
    columns: Columns,
    section: Attached,
    channels: Mapping[int, MessageChannel],
    since: int,
    *,
    is_last: bool,
) -> bool:
    checksum, length = _HEAD.unpack_from(section.data)
    packed = section.data[_HEAD.size :]
    if zlib.crc32(packed) != checksum:
        raise RecordingError("the index is damaged")
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(packed, _MOST_BYTES)
    about = json.loads(data[:length])
    found = about["format"], about["place"], about["since"], about["is_last"]
    if found != (_FORMAT, section.offset, since, is_last) or unpacker.unconsumed_tail:
        return False
    middle = length + int(about["frames"])
    columns.frames.load(data[length:middle], [channels[n] for n in about["channels"]])
    columns.lessons.load(data[middle:], about["lessons"])
    columns.span.load(about["span"])
    columns.add_results(about["results"])
    return True
