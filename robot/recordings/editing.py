"""A recording as a person sees it: with its labels, and with the edits applied."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import BinaryIO

from robot.driver import CLASSIC
from robot.errors import ConfigurationError
from robot.policy.history import Edited, Taught, Undone
from robot.recordings.edits import Edit, Notes, Range, trim
from robot.recordings.episode import Episode, taught_frames
from robot.recordings.messages import EDITED, MODEL_BEFORE, Fields, Topic
from robot.recordings.reader import Message, scan
from robot.recordings.teaching import plan, surviving
from robot.recordings.writer import FORMAT, EpisodeWriter
from robot.store.models.events import describe_event, read_point
from robot.types import Action, Point

_SOON_S = 0.5
"""What comes later than this after a picture is not about it: the robot stood in between."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeFrame:
    """One picture with what belongs to it. `at_s` counts from the recording's beginning.

    The points are there where the pilot taught, or the robot drove, by degrees.
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
    """x and y in metres, heading in radians."""
    is_pose_estimate: bool = False
    """True if the pose was reckoned from the wheels; in simulation it is the truth."""


def moments(episode: Episode, notes: Notes) -> list[EpisodeFrame]:
    """List the recording's pictures in order, each with label, prediction and driver."""
    examples = taught_frames(episode)
    predictions = {
        fields["frame"]: fields for _, fields in episode.messages.get(Topic.PREDICTION, [])
    }
    decisions = episode.messages.get(Topic.DECISION, [])
    sensed = episode.messages.get(Topic.SENSORS, [])
    start_s, found = episode.start_s, []
    for entry in episode.frames.values():
        decision = _next_of(decisions, entry.captured_s)
        senses = _next_of(sensed, entry.captured_s)
        pose = senses.get("pose")
        proposed = predictions.get(entry.frame_id, {})
        relabel, example = notes.relabel(entry.frame_id), examples.get(entry.frame_id)
        label = relabel or (example.label if example else None)
        found.append(
            EpisodeFrame(
                frame_id=entry.frame_id,
                at_s=entry.captured_s - start_s,
                label=label,
                point=example.point if example and example.label is label else None,
                is_relabelled=relabel is not None,
                is_deleted=notes.is_deleted(entry.frame_id),
                is_intervention=example is not None and example.is_intervention,
                predicted=proposed.get("action"),
                predicted_point=read_point(proposed),
                confidence=proposed.get("confidence"),
                driven_by=decision.get("driven_by"),
                sent=decision.get("sent"),
                sent_point=read_point(decision),
                asks_pilot=bool(decision.get("asks_pilot")),
                distance_m=senses.get("distance_m"),
                bumped=bool(senses.get("bumped")),
                pose=pose and (pose["x_m"], pose["y_m"], pose["heading_rad"]),
                is_pose_estimate=bool(pose and pose.get("is_estimate")),
            )
        )
    return found


def _next_of(messages: Sequence[tuple[float, Fields]], at_s: float) -> Fields:
    """Return the first message that is not older; an empty one if none follows soon."""
    index = bisect_left(messages, at_s, key=itemgetter(0))
    return next((fields for s, fields in messages[index : index + 1] if s - at_s < _SOON_S), {})


def edit_of(verb: str, between: Range, episode: Episode, label: str | None = None) -> Edit:
    """Return what a person wants done to a range of frames; `trim` keeps these alone."""
    if verb == "trim":
        return trim(episode.frames, *between)
    move = None
    if verb == "relabel":
        known = tuple(dict.fromkeys((*episode.moves, *CLASSIC)))
        if label is None or label not in known:
            raise ConfigurationError(f"unknown label {label!r}; known: {', '.join(known)}")
        move = Action(label)
    return Edit(verb=verb, ranges=(between,), label=move)


def choose(found: Sequence[EpisodeFrame], count: int) -> list[EpisodeFrame]:
    """Choose `count` moments at even distances, for a strip."""
    if len(found) <= count:
        return list(found)
    return [found[round(i * (len(found) - 1) / max(count - 1, 1))] for i in range(count)]


def write_edited(episode: Episode, notes: Notes, file: BinaryIO, *, is_part: bool = False) -> None:
    """Write a copy of the recording with the edits applied.

    Undone examples and deleted frames are left out; relabelled frames have their new label. Frame
    ids and predictions are unchanged. Edits of learned images go along, for a later recording may
    take them back; not into a part, as what it was split from has them.
    """
    run = {**episode.run, "format": str(FORMAT), **({EDITED: "1"} if notes.edits else {})}
    writer = EpisodeWriter(file, run, episode.attachments.get(MODEL_BEFORE))
    kept_s = [each.captured_s for i, each in episode.frames.items() if not notes.is_deleted(i)]
    ends_s = kept_s or [episode.start_s, episode.start_s + episode.duration_s]
    first_s, last_s = min(ends_s), max(ends_s)
    for record in scan(episode.path):
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
    """Write what was undone of an earlier recording, and what is to be learned."""
    undone = [event for _, event in surviving([(episode, notes)]) if isinstance(event, Undone)]
    for event in (*undone, *(step.event for step in plan([(episode, notes)]))):
        if is_part and (isinstance(event, Edited) or event == Undone(frame_ids=())):
            continue
        if isinstance(event, Taught) and event.example.frame_id in episode.frames:
            now_s = episode.frames[event.example.frame_id].captured_s
        writer.write_message(Topic.LESSON, now_s, describe_event(event))
