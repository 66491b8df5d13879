"""One recording, opened: an index in memory, pictures read from the file when asked for."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from robot.driver import Move, from_text
from robot.errors import UNREADABLE, RecordingError
from robot.policy.history import HistoryEvent
from robot.recordings.images import FrameEntry, decode_image
from robot.recordings.messages import MODEL_AFTER, MODEL_BEFORE, RUN, SUMMARY, Fields, Topic
from robot.recordings.reader import Attachment, Cut, Message, Metadata, read_chunk, scan
from robot.recordings.writer import FORMAT, note_taught
from robot.store.models.events import read_event
from robot.store.models.model import Model, decode_model
from robot.types import Action, Example, Frame

_CHUNKS_KEPT = 4
_LATEST_S = 2.5e11  # the year 9892: later ones have no date
_READ = set(Topic) - {Topic.POSE}  # which the sensors have, too


@dataclass(slots=True, kw_only=True)
class Episode:
    """What a recording holds. Times are seconds of the run's clock.

    `on_read` is called for each picture that is read: a command shows by it how far it is.
    """

    path: Path
    run: dict[str, str] = field(default_factory=dict)
    frames: dict[int, FrameEntry] = field(default_factory=dict)
    events: list[tuple[float, HistoryEvent]] = field(default_factory=list)
    messages: dict[str, list[tuple[float, Fields]]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    damage: str | None = None
    on_read: Callable[[], None] = lambda: None
    _read_chunk: Callable[[Path, int], list[bytes]] = field(
        default_factory=lambda: lru_cache(_CHUNKS_KEPT)(read_chunk)
    )

    @property
    def id(self) -> str:
        """The recording's name: its file's, so that a copy has a name of its own."""
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
        entries = list(self.frames.values())
        yield from (entry.captured_s for entry in entries[:1] + entries[-1:])
        for received in self.messages.values():
            yield from (now_s for now_s, _ in received[:1] + received[-1:])
        yield from (now_s for now_s, _ in self.events[:1] + self.events[-1:])

    def frame(self, frame_id: int) -> Frame:
        entry = self.frames.get(frame_id)
        if entry is None:
            raise RecordingError(f"the recording {self.id} has no frame {frame_id}")
        self.on_read()
        offset, index = entry.place
        return decode_image(entry, self._read_chunk(self.path, offset)[index])

    def model_before(self) -> Model | None:
        return self._model(MODEL_BEFORE)

    def model_after(self) -> Model | None:
        return self._model(MODEL_AFTER)

    def _model(self, name: str) -> Model | None:
        data = self.attachments.get(name)
        return None if data is None else decode_model(data)


def open_episode(path: Path) -> Episode:
    """Read a recording's messages and the positions of its pictures; a cut file up to its end.

    RecordingError if it is not a recording of this program, or of a newer format.
    """
    episode = Episode(path=path)
    for record in scan(path):
        try:
            _take(episode, record)
        except UNREADABLE as error:
            if not episode.run:
                raise RecordingError(f"{path.name} cannot be read: {error}") from error
            episode.damage = str(error)
            break
    if not episode.run:
        raise RecordingError(f"{path.name} is not a recording of this program, or is empty")
    episode.frames = dict(sorted(episode.frames.items()))
    return episode


def _take(episode: Episode, record: Message | Metadata | Attachment | Cut) -> None:
    if isinstance(record, Message):
        if episode.run:
            _take_message(episode, record)
    elif isinstance(record, Attachment):
        episode.attachments[record.name] = record.data
    elif isinstance(record, Cut):
        episode.damage = record.reason
    elif record.name == RUN:
        episode.run = check_run(record.values)
    elif record.name == SUMMARY:
        episode.damage = record.values.get("damage")


def check_run(values: dict[str, str]) -> dict[str, str]:
    """Return what a recording says of itself."""
    if int(values["format"]) > FORMAT:
        raise RecordingError("it was recorded by a newer version; update this program")
    int(values["origin_ns"])
    seconds_in(values.get("started_at_s", "0"))
    from_text(values.get("declared_moves", ""))
    return values


def seconds_in(text: str) -> float:
    """Read how long something took, or when it was; ValueError for what is no date."""
    number = float(text)
    if not 0 <= number <= _LATEST_S:
        raise ValueError(f"{text!r} is no time")
    return number


def _take_message(episode: Episode, message: Message) -> None:
    now_s = (message.log_ns - episode.origin_ns) / 1e9
    if message.topic == Topic.CAMERA:
        size = dict(message.channel.metadata)
        episode.frames[message.sequence] = FrameEntry(
            frame_id=message.sequence,
            captured_s=now_s,
            schema=message.channel.schema.name,
            size=(int(size.get("width", "0")), int(size.get("height", "0"))),
            place=message.place,
        )
    elif message.topic == Topic.LESSON:
        episode.events.append((now_s, read_event(json.loads(message.data))))
    elif message.topic in _READ:
        fields = json.loads(message.data)
        if not isinstance(fields, dict):
            raise RecordingError("a message has an unknown form")
        episode.messages.setdefault(message.topic, []).append((now_s, fields))


def taught_frames(episode: Episode) -> dict[int, Example]:
    """Return the frames that were taught and not undone, with the last example of each."""
    taught: dict[int, Example] = {}
    for _, event in episode.events:
        note_taught(taught, event)
    return taught
