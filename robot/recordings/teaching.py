"""Retraining from recordings: the recorded examples, with a person's edits applied.

The same examples in the same order yield the same learner, bit for bit. Pictures are stored exactly
as the camera sent them, and examples that were undone while driving are left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.errors import ConfigurationError
from robot.policy.changes import replay
from robot.policy.events import Edited, LogEvent, Taught, Undone
from robot.policy.policy import Policy
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.recordings.messages import EDITED
from robot.types import Action, Example

EditedEpisode = tuple[Episode, Notes]
"""A recording with its edits."""


class Step(NamedTuple):
    """One step of learning from a recording: an edit, or an example with its current label.

    The vector of an example is empty if its picture was recorded. The example of a frame that a
    person labelled after the drive has the teaching time -1.
    """

    episode: Episode
    event: Taught | Edited


@dataclass(slots=True, kw_only=True)
class Report:
    """The outcome of retraining."""

    taught: Counter[Action]
    left_out_edits: int = 0
    missing_frames: int = 0

    def leave_out(self, event: LogEvent, error: Exception) -> None:
        """Count an edit of a learned image that this policy cannot repeat."""
        self.left_out_edits += 1


def plan(episodes: Sequence[EditedEpisode]) -> Iterator[Step]:
    """Yield the steps to learn, in order, without undone and deleted steps."""
    for (episode, notes), rows in zip(episodes, surviving(episodes), strict=True):
        late = _labelled_late(episode, notes)
        due = next(late, None)
        for event in map(episode.events.event, rows.tolist()):
            if isinstance(event, Edited):
                yield Step(episode, event)
            elif isinstance(event, Taught):
                frame_id = event.example.frame_id
                while due is not None and due.example.frame_id < frame_id:
                    yield Step(episode, due)
                    due = next(late, None)
                if not notes.is_deleted(frame_id):
                    label = notes.relabel(frame_id) or event.example.label
                    example = event.example
                    if label is not example.label:
                        example = replace(example, label=label, point=None)
                    at_s = event.at_s if "timed" in episode.run else -1.0
                    yield Step(episode, replace(event, example=example, at_s=at_s))
        while due is not None:
            yield Step(episode, due)
            due = next(late, None)


def count_steps(episodes: Sequence[EditedEpisode]) -> int:
    """Return the number of steps of `plan`."""
    return sum(1 for _ in plan(episodes))


def _labelled_late(episode: Episode, notes: Notes) -> Iterator[Taught]:
    """Yield frames that were not examples while driving, but were labelled afterwards."""
    ids = episode.frames.ids
    named = np.zeros(len(ids), bool)
    for first, last in (r for edit in notes.edits if edit.verb == "relabel" for r in edit.ranges):
        named |= (ids >= first) & (ids <= last)
    named &= ~np.isin(ids, episode.events.frames) & ~notes.deleted(ids)
    for frame_id in ids[named].tolist():
        label = notes.relabel(frame_id)
        if label:
            example = Example(frame_id=frame_id, label=label, is_intervention=False)
            yield Taught(example=example, x=np.zeros(0), at_s=-1.0)


def surviving(episodes: Sequence[EditedEpisode]) -> list[NDArray[np.intp]]:
    """Return, for each recording, the indices of the events that were not undone. An event can be
    undone by its own recording or by a later recording of the same run. An undo event is kept if it
    undoes examples of a recording before all `episodes`."""
    counts = [np.ones(len(episode.events), bool) for episode, _ in episodes]
    frames = [episode.events.frames for episode, _ in episodes]
    for place, (episode, _) in enumerate(episodes):
        for row in episode.events.rows_of(Undone):
            event = episode.events.event(row)
            assert isinstance(event, Undone)
            counts[place][row] = False  # an undo event applies only once
            gone = 0
            if not event.frame_ids:
                gone = _undo_edit(episodes, counts, place, row)
            for earlier in range(place + 1) if event.frame_ids else ():
                if episodes[earlier][0].run.get("run", "") == episode.run.get("run", ""):
                    end = row if earlier == place else len(counts[earlier])
                    meant = np.isin(frames[earlier][:end], event.frame_ids) & counts[earlier][:end]
                    counts[earlier][:end][meant] = False
                    gone += int(meant.sum())
            counts[place][row] = gone < max(1, len(event.frame_ids))
    return [np.flatnonzero(counted) for counted in counts]


def _undo_edit(
    episodes: Sequence[EditedEpisode], counts: list[NDArray[np.bool_]], place: int, row: int
) -> int:
    """Search backwards from the event `row` of the episode `place`, and mark the first edit of a
    learned image that is found as undone. Return the number of edits that were marked, 0 or 1."""
    for earlier in range(place, -1, -1):
        for edited in reversed(episodes[earlier][0].events.rows_of(Edited)):
            if counts[earlier][edited] and (earlier < place or edited < row):
                counts[earlier][edited] = False
                return 1
    return 0


def learn_again(
    policy: Policy,
    episodes: Sequence[EditedEpisode],
    *,
    only: Callable[[Step], bool] = lambda step: True,
    on_step: Callable[[], None] = lambda: None,
) -> Report:
    """Teach the policy all steps of the recordings.

    Edits of learned images are repeated only as long as the learned images are the same as during
    the drives. The images become different as soon as a recording has edits or was driven with
    another learner. From this recording on, edits of learned images are left out and counted.
    Raises ConfigurationError if a label is not one of the policy's moves.
    """
    same = takewhile(lambda one: _is_as_driven(policy, *one), episodes)
    faithful = [episode for episode, _ in same]
    if declared := [move for episode, _ in episodes for move in episode.declared_moves]:
        policy.kinds.describe(declared)
    report = Report(taught=Counter())
    for step in filter(only, plan(episodes)):
        if isinstance(step.event, Taught):
            event = _seen_by(policy, step.episode, step.event)
            if event is None:
                report.missing_frames += 1
            else:
                replay(policy, [event])
                report.taught[event.example.label] += 1
        elif step.episode in faithful:
            replay(policy, [step.event], report.leave_out)
        else:
            report.left_out_edits += 1
        on_step()
    return report


def _is_as_driven(policy: Policy, episode: Episode, notes: Notes) -> bool:
    is_edited = notes.edits or EDITED in episode.run
    return episode.run.get("learner") == policy.name and not is_edited


def _seen_by(policy: Policy, episode: Episode, event: Taught) -> Taught | None:
    """Return the example with a feature vector for this policy, computed from the recorded picture.
    If the picture was not recorded, the recorded vector is used. Return None if no vector was
    recorded, or if another learner computed it."""
    frame_id, label = event.example.frame_id, event.example.label
    if label not in policy.moves:
        raise ConfigurationError(
            f"{episode.id} contains examples of {label.value!r}, which is not one of the moves "
            f"{', '.join(policy.moves)}"
        )
    if frame_id in episode.frames:
        return replace(event, x=policy.extract(episode.frame(frame_id)))
    return event if event.x.size and episode.run.get("learner") == policy.name else None
