"""The recording that people see: its pictures with labels, after the edits are applied."""

from __future__ import annotations

import json
from bisect import bisect_left
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, groupby, islice
from typing import BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from robot.errors import UNREADABLE, ConfigurationError
from robot.moves import CLASSIC
from robot.policy.events import Edited, Taught, Undone, read_point
from robot.recordings.columns import Labels
from robot.recordings.edits import Edit, Notes, Range, trim
from robot.recordings.episode import Episode, taught_frames
from robot.recordings.messages import EDITED, MODEL_BEFORE, Fields, Topic
from robot.recordings.parts import scan_parts
from robot.recordings.reader import Block, Message
from robot.recordings.teaching import plan, surviving
from robot.recordings.writer import FORMAT, EpisodeWriter
from robot.types import Action, Point

_SOON_S = 0.5
"""A message belongs to a picture if it comes at most this many seconds later. If the next message
comes later, the robot stood still until then."""
_LATE_S = 2.0
"""The policy's proposal for a picture comes at most this many seconds after the picture, even on a
slow computer."""
_MOST_WAITING = 20_000
_BATCH = 256
"""`_describe` gets at least this many pictures at a time, except at the end, because the messages
about a picture come after the picture."""
ABOUT = Topic.DECISION, Topic.SENSORS, Topic.PREDICTION
"""The topics of the messages that describe a picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeFrame:
    """One picture with its data. `at_s` counts from the recording's beginning.

    `point`, `predicted_point` and `sent_point` contain steering and throttle. Each point is None
    unless the pilot or the robot steered proportionally.
    """

    frame_id: int
    at_s: float
    label: Action | None
    is_relabelled: bool
    is_deleted: bool
    point: Point | None = None
    is_intervention: bool = False
    predicted: str | None = None
    predicted_point: Point | None = None
    confidence: float | None = None
    driven_by: str | None = None
    sent: str | None = None
    sent_point: Point | None = None
    asks_pilot: bool = False
    distance_m: float | None = None
    bumped: bool = False
    pose: tuple[float, float, float] | None = None
    """x and y in metres, and the heading in radians."""
    is_pose_estimate: bool = False
    """True if the pose was estimated from the wheels; in simulation it is exact."""


def moments(
    episode: Episode, notes: Notes, about: Collection[Topic] = ABOUT
) -> Iterator[EpisodeFrame]:
    """Yield the recording's pictures in order, each with label, prediction and driver.

    The recording is read chunk by chunk, so that only some hundred pictures are in memory. Of the
    messages, only those with a topic in `about` are read. If `about` is empty, no chunk is read.
    """
    table, labels = episode.frames, taught_frames(episode)
    ranks = range(len(table))
    if not about:
        return _labelled(episode, notes, labels)
    in_file = _with_messages(episode, notes, labels, episode.blocks(), ranks, about)
    if table.is_ordered:
        return in_file
    return iter(sorted(in_file, key=lambda moment: moment.frame_id))


def _labelled(episode: Episode, notes: Notes, labels: Labels) -> Iterator[EpisodeFrame]:
    """Yield the pictures in order, without messages."""
    said = _TopicMessages(), _TopicMessages(), _TopicMessages()
    for begin in range(0, len(episode.frames), _BATCH):
        ranks = np.arange(begin, min(begin + _BATCH, len(episode.frames)))
        yield from _describe(episode, notes, labels, ranks, said)


def sample(
    episode: Episode,
    notes: Notes,
    count: int,
    between: Range | None = None,
) -> list[EpisodeFrame]:
    """Return at most `count` moments, evenly spaced in the recording or in a range of its frames.
    Only the chunks that contain the returned moments are read."""
    table, labels = episode.frames, taught_frames(episode)
    ranks = range(len(table))
    if between is not None:
        first, last = (max(0, min(frame_id, 2**32 - 1)) for frame_id in between)
        ranks = range(*np.searchsorted(table.ids, [first, last + 1]).tolist())
    chosen = [int(ranks[i]) for i in even(len(ranks), count)]
    found: list[EpisodeFrame] = []
    for offset, same in groupby(chosen, key=lambda rank: table.table["chunk"][rank]):
        own, blocks = list(same), episode.blocks_after(int(offset))
        read = list(islice(blocks, 1))
        here = list(_with_messages(episode, notes, labels, read, own))
        if any(None in (one.predicted, one.driven_by, one.distance_m) for one in here):
            read += islice(blocks, 1)  # the next chunk may contain the missing messages
            here = list(_with_messages(episode, notes, labels, read, own))
        found += here
    return found


def even(total: int, count: int) -> list[int]:
    """Return at most `count` evenly spaced numbers from 0 to `total` - 1."""
    if total <= count:
        return list(range(total))
    return [round(i * (total - 1) / max(count - 1, 1)) for i in range(count)]


def labels(episode: Episode, notes: Notes) -> Iterator[Action]:
    """Yield the labels of the pictures that have a label and are not deleted."""
    taught, ids = taught_frames(episode), episode.frames.ids
    for frame_id in ids[~notes.deleted(ids)].tolist():
        if label := notes.relabel(frame_id):
            yield label
        elif example := taught.get(frame_id):
            yield example.label


class _TopicMessages:
    """The messages of one topic, ordered by time. A message is parsed only when it is needed."""

    def __init__(self) -> None:
        self._times_s: list[float] = []
        self._messages: list[bytes | Fields] = []

    def add(self, block: Block, topic: Topic, origin_ns: int) -> None:
        rows = block.of(topic)
        self._times_s += ((rows["log_ns"].astype("<i8") - origin_ns) / 1e9).tolist()
        self._messages += block.texts(rows)

    def first(self, at_s: float) -> Fields:
        """Return the first message at or after `at_s`. Return empty fields if there is none within
        `_SOON_S`."""
        index = bisect_left(self._times_s, at_s)
        if index == len(self._times_s) or self._times_s[index] - at_s >= _SOON_S:
            return {}
        return self._at(index)

    def about(self, frame_id: int, at_s: float) -> Fields:
        """Return the first message that names this picture, which was taken at `at_s`; empty if
        there is no such message."""
        times_s = self._times_s
        for index in range(bisect_left(times_s, at_s), len(times_s)):
            if times_s[index] - at_s >= _LATE_S:
                break
            if (fields := self._at(index)).get("frame") == frame_id:
                return fields
        return {}

    def _at(self, index: int) -> Fields:
        message = self._messages[index]
        if isinstance(message, bytes):
            message = self._messages[index] = _fields_in(message)
        return message

    def forget(self, before_s: float) -> None:
        count = bisect_left(self._times_s, before_s)
        del self._times_s[:count], self._messages[:count]


def _fields_in(message: bytes) -> Fields:
    """Read a message; return empty fields if it is damaged."""
    try:
        # if `json` were given bytes, it would guess their encoding
        fields = json.loads(str(message, "utf-8"))
    except UNREADABLE:
        return {}
    return fields if isinstance(fields, dict) else {}


def _with_messages(
    episode: Episode,
    notes: Notes,
    labels: Labels,
    blocks: Iterable[Block],
    ranks: Sequence[int],
    about: Collection[Topic] = ABOUT,
) -> Iterator[EpisodeFrame]:
    """Yield the pictures with these ranks as soon as their chunks have been read."""
    table, origin_ns = episode.frames.table, episode.origin_ns
    said = _TopicMessages(), _TopicMessages(), _TopicMessages()
    chosen = np.asarray(ranks, np.int64)
    places = np.lexsort((table["start"][chosen], table["chunk"][chosen]))
    by_place = chosen[places]
    chunks, stamps_ns = table["chunk"][by_place], table["log_ns"][by_place]
    told = came = 0
    for block in blocks:
        for messages, topic in zip(said, ABOUT, strict=True):
            if topic in about:
                messages.add(block, topic, origin_ns)
        came = int(np.searchsorted(chunks, block.offset, side="right"))
        known_ns = 0
        if len(block.rows):
            known_ns = int(block.rows["log_ns"].max()) - round(_LATE_S * 1e9)
        waiting_ns = stamps_ns[told:came]
        late = waiting_ns >= known_ns
        count = int(late.argmax()) if late.any() else len(late)
        count = max(count, len(waiting_ns) - _MOST_WAITING)
        if count < min(_BATCH, len(by_place) - told):
            continue
        yield from _describe(episode, notes, labels, by_place[told : told + count], said)
        told += count
        if told == len(by_place):
            return
        needed_ns = int(stamps_ns[told]) if told < came else known_ns
        for messages in said:
            messages.forget((needed_ns - origin_ns) / 1e9)
    yield from _describe(episode, notes, labels, by_place[told:came], said)


def _describe(
    episode: Episode,
    notes: Notes,
    labels: Labels,
    ranks: NDArray[np.int64],
    said: tuple[_TopicMessages, _TopicMessages, _TopicMessages],
) -> Iterator[EpisodeFrame]:
    """Yield the pictures of a group, each with the messages about it."""
    decisions, sensed, proposed = said
    ids, captured_s, start_s = (
        episode.frames.ids[ranks],
        episode.frames.captured_s_of(ranks).tolist(),
        episode.start_s,
    )
    examples, deleted = labels.examples(ids), notes.deleted(ids).tolist()
    relabels = notes.relabels(ids)
    every = zip(ids.tolist(), captured_s, examples, deleted, relabels, strict=True)
    for frame_id, at_s, example, is_deleted, relabel in every:
        decision, senses = decisions.first(at_s), sensed.first(at_s)
        prediction, pose = proposed.about(frame_id, at_s), senses.get("pose")
        label = relabel or (example.label if example else None)
        yield EpisodeFrame(
            frame_id=frame_id,
            at_s=at_s - start_s,
            label=label,
            point=example.point if example and example.label is label else None,
            is_relabelled=relabel is not None,
            is_deleted=is_deleted,
            is_intervention=example is not None and example.is_intervention,
            predicted=prediction.get("action"),
            predicted_point=read_point(prediction) if "steering" in prediction else None,
            confidence=prediction.get("confidence"),
            driven_by=decision.get("driven_by"),
            sent=decision.get("sent"),
            sent_point=read_point(decision) if "steering" in decision else None,
            asks_pilot=bool(decision.get("asks_pilot")),
            distance_m=senses.get("distance_m"),
            bumped=bool(senses.get("bumped")),
            pose=pose and (pose["x_m"], pose["y_m"], pose["heading_rad"]),
            is_pose_estimate=bool(pose and pose.get("is_estimate")),
        )


def edit_of(verb: str, between: Range, episode: Episode, label: str | None = None) -> Edit:
    """Return the edit that a person requested for a range of frames; `trim` keeps only this
    range."""
    if verb == "trim":
        return trim(episode.frames, *between)
    move = None
    if verb == "relabel":
        known = tuple(dict.fromkeys((*episode.moves, *CLASSIC)))
        if label is None or label not in known:
            raise ConfigurationError(f"unknown label {label!r}; known: {', '.join(known)}")
        move = Action(label)
    return Edit(verb=verb, ranges=(between,), label=move)


class EditedWriter(Protocol):
    """A function that runs `write_edited`, perhaps in another process."""

    def __call__(
        self, episode: Episode, notes: Notes, file: BinaryIO, *, is_part: bool = False
    ) -> None: ...


def write_edited(episode: Episode, notes: Notes, file: BinaryIO, *, is_part: bool = False) -> None:
    """Write a copy of the recording with the edits applied.

    Undone examples and deleted frames are left out; relabelled frames have their new label. Frame
    ids and predictions are unchanged. Edits of learned images are copied, so that a later recording
    can still undo them. With `is_part` these edits are not copied, because they stay in the
    recording from which the part was split.
    """
    run = {**episode.run, "format": str(FORMAT), **({EDITED: "1"} if notes.edits else {})}
    writer = EpisodeWriter(file, run, episode.attachments.get(MODEL_BEFORE))
    kept_s = episode.frames.captured_s[~notes.deleted(episode.frames.ids)]
    first_s, last_s = episode.start_s, episode.start_s + episode.duration_s
    if len(kept_s):
        first_s, last_s = float(kept_s.min()), float(kept_s.max())
    for record in scan_parts(episode.path):
        if not isinstance(record, Message) or record.topic == Topic.LESSON:
            continue
        at_s = (record.log_ns - episode.origin_ns) / 1e9
        is_near = first_s - _SOON_S <= at_s <= last_s + _SOON_S
        if is_near and not (record.topic == Topic.CAMERA and notes.is_deleted(record.sequence)):
            writer.write_copy(record)
    _write_events(writer, episode, notes, first_s, is_part)
    writer.close({"dropped_frames": "0", "lost_words": "0"})


def _write_events(
    writer: EpisodeWriter, episode: Episode, notes: Notes, now_s: float, is_part: bool
) -> None:
    """Write the examples that were not undone, and the undo events that concern examples of an
    earlier recording."""
    events = episode.events
    [rows] = surviving([(episode, notes)])
    undone = map(events.event, np.intersect1d(events.rows_of(Undone), rows).tolist())
    for event in chain(undone, (step.event for step in plan([(episode, notes)]))):
        if is_part and (isinstance(event, Edited) or event == Undone(frame_ids=())):
            continue
        if isinstance(event, Taught) and event.example.frame_id in episode.frames:
            now_s = episode.frames[event.example.frame_id].captured_s
        writer.write_lesson(now_s, event)
