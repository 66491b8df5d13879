"""An open recording: compact columns are in memory; pictures and messages are read from the file
when needed."""

from __future__ import annotations

import contextlib
import struct
import threading
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robot.errors import UNREADABLE, RecordingError
from robot.moves import Move
from robot.recordings.columns import FrameTable, Labels, LessonTable, read_fields
from robot.recordings.images import decode_image
from robot.recordings.index import INDEX, Columns, read_columns
from robot.recordings.messages import (
    CONTINUES,
    MODEL_AFTER,
    MODEL_BEFORE,
    PART,
    RUN,
    SUMMARY,
    Fields,
    Topic,
)
from robot.recordings.moves import from_text
from robot.recordings.parts import (
    base_of,
    blocks_after,
    part_paths,
    read_chunk_at,
    walk_part,
)
from robot.recordings.reader import (
    CUT_SHORT,
    Attachment,
    Block,
    Cut,
    Ends,
    MessageChannel,
    Metadata,
)
from robot.recordings.writer import FORMAT
from robot.store.models.model import Model, decode_model
from robot.types import Action, Frame

_CHUNKS_BYTES = 8 * 2**20
"""Size of the cache of unpacked chunks of an open recording, in bytes."""
_LATEST_S = 2.5e11  # in the year 9892, shortly before the end of `datetime`


@dataclass(slots=True, kw_only=True)
class Episode:
    """An open recording: the content of all of its files. Times are seconds of the run's clock.

    `on_read` is called for each picture that is read, for a command's progress display.
    """

    path: Path
    run: dict[str, str] = field(default_factory=dict)
    columns: Columns = field(default_factory=Columns)
    channels: dict[int, Mapping[int, MessageChannel]] = field(default_factory=dict)
    """Maps each file's number to a mapping from channel numbers to the file's channels."""
    attachments: dict[str, bytes] = field(default_factory=dict)
    damage: str | None = None
    on_read: Callable[[], None] = lambda: None
    _chunks: dict[int, bytes] = field(default_factory=dict)
    _chunks_bytes: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    @property
    def frames(self) -> FrameTable:
        """The positions of the pictures in the file."""
        return self.columns.frames

    @property
    def events(self) -> LessonTable:
        """The teaching and undo events."""
        return self.columns.lessons

    @property
    def results(self) -> list[Fields]:
        """The results that extensions recorded, such as tries of a challenge. `of` names the kind
        of result; `at_s` is the time since the recording began."""
        origin_ns, start_s = self.origin_ns, self.start_s
        return [
            {**fields, "at_s": round((stamp_ns - origin_ns) / 1e9 - start_s, 3)}
            for stamp_ns, fields in self.columns.results
        ]

    @property
    def id(self) -> str:
        """The recording's name, which is the name of its file without the extension."""
        return self.path.stem

    @property
    def origin_ns(self) -> int:
        """The zero of the run's clock, in nanoseconds since 1970."""
        return int(self.run.get("origin_ns", "0"))

    @property
    def started_at_s(self) -> float:
        """The wall-clock time at which the recording began, in seconds since 1970."""
        started = seconds_in(self.run.get("started_at_s", "0"))
        return started if started > 0 else self.origin_ns / 1e9 + self.start_s

    @property
    def moves(self) -> tuple[Action, ...]:
        return tuple(Action(move) for move in self.run.get("moves", "").split(",") if move)

    @property
    def declared_moves(self) -> tuple[Move, ...]:
        """The moves that the driver declared; empty if the recording names none."""
        return from_text(self.run.get("declared_moves", ""))

    @property
    def start_s(self) -> float:
        return min(self._ends(), default=0.0)

    @property
    def duration_s(self) -> float:
        return max(self._ends(), default=0.0) - self.start_s

    def _ends(self) -> Iterator[float]:
        if len(self.frames):
            yield from self.frames.captured_s_of(np.array([0, -1])).tolist()
        yield from ((end_ns - self.origin_ns) / 1e9 for end_ns in self.columns.span.ends_ns)

    def frame(self, frame_id: int) -> Frame:
        entry = self.frames.get(frame_id)
        if entry is None:
            raise RecordingError(f"the recording {self.id} has no frame {frame_id}")
        self.on_read()
        offset, start, stop = entry.place
        return decode_image(entry, self._chunk(offset)[start:stop])

    def _chunk(self, offset: int) -> bytes:
        data = self._chunks.get(offset)
        return self._keep(offset, read_chunk_at(self.path, offset)) if data is None else data

    def _keep(self, offset: int, data: bytes) -> bytes:
        """Keep the last chunks in memory, because their pictures are needed within the next
        seconds.

        An imported recording has few, large chunks; a driven recording has five chunks a second.
        """
        with self._lock:
            if offset not in self._chunks:
                self._chunks[offset] = data
                self._chunks_bytes += len(data)
            while self._chunks_bytes > _CHUNKS_BYTES and len(self._chunks) > 1:
                self._chunks_bytes -= len(self._chunks.pop(next(iter(self._chunks))))
        return data

    def blocks(self) -> Iterator[Block]:
        """Yield the recording chunk by chunk, and keep the pictures of the last chunks in
        memory."""
        for block in self.blocks_after(0):
            self._keep(block.offset, block.data)
            yield block

    def blocks_after(self, offset: int) -> Iterator[Block]:
        """Yield the recording's chunks, beginning with the chunk at `offset`."""
        return blocks_after(self.path, offset, self.channels)

    def messages(self, topic: Topic) -> Iterator[tuple[float, Fields]]:
        """Yield the messages of a topic with their times, in the order of the file."""
        for block in self.blocks():
            rows = block.of(topic)
            yield from zip(
                ((rows["log_ns"].astype("<i8") - self.origin_ns) / 1e9).tolist(),
                read_fields(block.texts(rows)),
                strict=True,
            )

    def model_before(self) -> Model | None:
        return self._model(MODEL_BEFORE)

    def model_after(self) -> Model | None:
        return self._model(MODEL_AFTER)

    def _model(self, name: str) -> Model | None:
        data = self.attachments.get(name)
        return None if data is None else decode_model(data)


def open_episode(path: Path) -> Episode:
    """Read a recording's events and its pictures' positions. A truncated file is read as far as
    possible.

    Raises RecordingError if the file is not a recording of this program, or has a newer format.
    """
    episode = Episode(path=path)
    files = part_paths(path)
    ends = ""
    if missing := set(range(max(files))) - set(files):
        episode.damage = f"part {min(missing)} is missing"
    for number, file in files.items():
        try:
            ends = _add_file(episode, number, file)
        except UNREADABLE as error:
            if not episode.run:
                raise RecordingError(f"{path.name} cannot be read: {error}") from error
            episode.damage = str(error)
        if not episode.run:
            raise RecordingError(f"{path.name} is not a recording of this program, or is empty")
    if ends and episode.damage is None:
        episode.damage = CUT_SHORT
    episode.run.pop(PART, None)
    return episode


def _add_file(episode: Episode, number: int, file: Path) -> str:
    """Add the content of one file. Return a non-empty text if the recording continues in another
    file, else "".

    Raises one of `UNREADABLE` for the first damaged part.
    """
    with contextlib.suppress(*UNREADABLE, OSError, MemoryError, struct.error, zlib.error):
        if (found := read_columns(file)) is not None:
            ends, columns = found
            return _add_indexed(episode, number, ends, columns)
    ends_with: dict[str, str] = {}
    for part in walk_part(number, file):
        if isinstance(part, Metadata) and part.name == SUMMARY:
            ends_with = part.values
        _take(episode, number, part)
    return ends_with.get(CONTINUES, "")


def _add_indexed(episode: Episode, number: int, ends: Ends, columns: Columns) -> str:
    _begin(episode, number, ends.metadata[RUN])
    if number == 0:
        episode.columns = columns
    else:
        episode.columns.extend(columns, base_of(number))
    episode.channels[number] = ends.channels
    episode.attachments.update(ends.attachments)
    episode.damage = episode.damage or ends.metadata[SUMMARY].get("damage")
    return ends.metadata[SUMMARY].get(CONTINUES, "")


def _begin(episode: Episode, number: int, run: dict[str, str]) -> None:
    if number == 0:
        episode.run = check_run(run)
        episode.frames.origin_ns = episode.origin_ns
    elif any(run.get(name) != episode.run.get(name) for name in ("episode", "run", "origin_ns")):
        raise RecordingError(f"part {number} belongs to another recording")


def _take(episode: Episode, number: int, part: Block | Metadata | Attachment | Cut) -> None:
    if isinstance(part, Block):
        if episode.run:
            episode.channels[number] = part.channels
            episode.columns.add(part)
    elif isinstance(part, Attachment):
        if part.name != INDEX:
            episode.attachments[part.name] = part.data
    elif isinstance(part, Cut):
        episode.damage = part.reason
    elif part.name == RUN:
        _begin(episode, number, part.values)
    elif part.name == SUMMARY:
        episode.damage = episode.damage or part.values.get("damage")


def check_run(values: dict[str, str]) -> dict[str, str]:
    """Check the metadata of a recording, and return them."""
    if int(values["format"]) > FORMAT:
        raise RecordingError("a newer version made this recording; upgrade Drivelesson")
    int(values["origin_ns"])
    seconds_in(values.get("started_at_s", "0"))
    from_text(values.get("declared_moves", ""))
    return values


def seconds_in(text: str) -> float:
    """Read a duration or a time; raises ValueError if it is invalid."""
    number = float(text)
    if not 0 <= number <= _LATEST_S:
        raise ValueError(f"{text!r} is not a time")
    return number


def taught_frames(episode: Episode) -> Labels:
    """Return the frames that were taught and not undone, each with its last example."""
    return Labels(episode.events)
