"""One recording, opened: compact columns in memory; pictures and messages are read from the file
when they are asked for."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from robot.driver import Move
from robot.errors import UNREADABLE, RecordingError
from robot.recordings.columns import FrameTable, Labels, LessonTable, Span, read_fields
from robot.recordings.images import decode_image
from robot.recordings.messages import MODEL_AFTER, MODEL_BEFORE, RUN, SUMMARY, Fields, Topic
from robot.recordings.moves import from_text
from robot.recordings.reader import (
    Attachment,
    Block,
    Cut,
    MessageChannel,
    Metadata,
    Part,
    blocks_from,
    read_chunk,
    walk,
)
from robot.recordings.writer import FORMAT
from robot.store.models.model import Model, decode_model
from robot.types import Action, Frame

_CHUNKS_KEPT = 4
_MOST_RESULTS = 1000
"""Number of results that are kept of a recording, the latest."""
_LATEST_S = 2.5e11  # the year 9892: later ones have no date
_READ = set(Topic) - {Topic.POSE}  # which the sensors have, too


@dataclass(slots=True, kw_only=True)
class Episode:
    """The content of a recording. Times are seconds of the run's clock.

    `results` are what extensions measured: `of` names the kind, `at_s` is its time from the start.

    `on_read` is called for each picture that is read, for a command's progress display.
    """

    path: Path
    run: dict[str, str] = field(default_factory=dict)
    frames: FrameTable = field(default_factory=FrameTable)
    events: LessonTable = field(default_factory=LessonTable)
    results: list[Fields] = field(default_factory=list)
    span: Span = field(default_factory=Span)
    channels: Mapping[int, MessageChannel] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    damage: str | None = None
    on_read: Callable[[], None] = lambda: None
    _chunks: dict[int, bytes] = field(default_factory=dict)

    @property
    def id(self) -> str:
        """The recording's name: that of its file, so that a copy has another name."""
        return self.path.stem

    @property
    def origin_ns(self) -> int:
        """Nanoseconds since 1970 at which the run's clock showed 0."""
        return int(self.run.get("origin_ns", "0"))

    @property
    def started_at_s(self) -> float:
        """Seconds since 1970 at which the recording began; by the wall clock."""
        started = seconds_in(self.run.get("started_at_s", "0"))
        return started if started > 0 else self.origin_ns / 1e9 + self.start_s

    @property
    def moves(self) -> tuple[Action, ...]:
        return tuple(Action(move) for move in self.run.get("moves", "").split(",") if move)

    @property
    def declared_moves(self) -> tuple[Move, ...]:
        """The moves as the driver declared them; empty in recordings of older versions."""
        return from_text(self.run.get("declared_moves", ""))

    @property
    def start_s(self) -> float:
        return min(self._ends(), default=0.0)

    @property
    def duration_s(self) -> float:
        return max(self._ends(), default=0.0) - self.start_s

    def _ends(self) -> Iterator[float]:
        if len(self.frames):
            yield from self.frames.captured_s[[0, -1]].tolist()
        yield from ((end_ns - self.origin_ns) / 1e9 for end_ns in self.span.ends_ns)

    def frame(self, frame_id: int) -> Frame:
        entry = self.frames.get(frame_id)
        if entry is None:
            raise RecordingError(f"the recording {self.id} has no frame {frame_id}")
        self.on_read()
        offset, start, stop = entry.place
        return decode_image(entry, self._chunk(offset)[start:stop])

    def _chunk(self, offset: int) -> bytes:
        data = self._chunks.get(offset)
        return self._keep(offset, read_chunk(self.path, offset)) if data is None else data

    def _keep(self, offset: int, data: bytes) -> bytes:
        """Cache the last few chunks: their pictures are mostly needed soon, and in order."""
        self._chunks[offset] = data
        for old in list(self._chunks)[:-_CHUNKS_KEPT]:
            self._chunks.pop(old, None)
        return data

    def blocks(self, offset: int = 0) -> Iterator[Block]:
        """Yield the recording chunk by chunk, from the beginning or from the chunk at an offset."""
        parts: Iterator[Part] = walk(self.path)
        if offset:
            parts = blocks_from(self.path, offset, self.channels)
        for part in parts:
            if isinstance(part, Block):
                self._keep(part.offset, part.data)
                yield part

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
    """Read a recording's lessons and the positions of its pictures; a truncated file up to its end.

    RecordingError if it is not a recording of this program, or of a newer format.
    """
    episode = Episode(path=path)
    for part in walk(path):
        try:
            _take(episode, part)
        except UNREADABLE as error:
            if not episode.run:
                raise RecordingError(f"{path.name} cannot be read: {error}") from error
            episode.damage = str(error)
            break
    if not episode.run:
        raise RecordingError(f"{path.name} is not a recording of this program, or is empty")
    return episode


def _take(episode: Episode, part: Block | Metadata | Attachment | Cut) -> None:
    if isinstance(part, Block):
        if episode.run:
            _take_block(episode, part)
    elif isinstance(part, Attachment):
        episode.attachments[part.name] = part.data
    elif isinstance(part, Cut):
        episode.damage = part.reason
    elif part.name == RUN:
        episode.run = check_run(part.values)
        episode.frames.origin_ns = episode.origin_ns
    elif part.name == SUMMARY:
        episode.damage = part.values.get("damage")


def _take_block(episode: Episode, block: Block) -> None:
    episode.channels = block.channels
    episode.frames.add(block)
    lessons = block.of(Topic.LESSON)
    times_s = ((lessons["log_ns"].astype("<i8") - episode.origin_ns) / 1e9).tolist()
    episode.span.add(block, _READ - {Topic.CAMERA})
    episode.events.add(times_s, block.texts(lessons))
    results = block.of(Topic.RESULT)
    stamps_ns = results["log_ns"].astype("<i8").tolist()
    for stamp_ns, fields in zip(stamps_ns, read_fields(block.texts(results)), strict=True):
        at_s = (stamp_ns - episode.origin_ns) / 1e9 - episode.start_s
        plain = {name: value for name, value in fields.items() if _is_plain(value)}
        episode.results.append({**plain, "at_s": round(at_s, 3)})
    del episode.results[:-_MOST_RESULTS]


def _is_plain(value: object) -> bool:
    """True for what every export can write: a text, a truth value or a finite number."""
    return isinstance(value, str | int) or (isinstance(value, float) and math.isfinite(value))


def check_run(values: dict[str, str]) -> dict[str, str]:
    """Return the metadata of a recording after checking them."""
    if int(values["format"]) > FORMAT:
        raise RecordingError("it was recorded by a newer version; upgrade Drivelesson")
    int(values["origin_ns"])
    seconds_in(values.get("started_at_s", "0"))
    from_text(values.get("declared_moves", ""))
    return values


def seconds_in(text: str) -> float:
    """Read a duration or a time; ValueError if it is not valid."""
    number = float(text)
    if not 0 <= number <= _LATEST_S:
        raise ValueError(f"{text!r} is not a time")
    return number


def taught_frames(episode: Episode) -> Labels:
    """Return the frames that were taught and not undone, with the last example of each."""
    return Labels(episode.events)
