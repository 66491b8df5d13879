"""Retraining from recordings: the recorded examples, with a person's edits applied.

The same examples in the same order make the same learner, bit for bit: pictures are stored as the
camera sent them, and examples that were undone while driving are left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from robot.errors import ConfigurationError
from robot.policy.history import Edited, HistoryEvent, LogEvent, Taught, Undone, replay
from robot.policy.policy import Policy
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.recordings.messages import EDITED
from robot.types import Action, Example

EditedEpisode = tuple[Episode, Notes]
"""A recording with its edits."""


class Step(NamedTuple):
    """One thing to learn of a recording: an edit, or an example with the label that it has now.

    The vector of an example is empty where its picture was recorded. One that a person labelled
    afterwards has the teaching time -1.
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
        """Count an edit that does not apply here."""
        self.left_out_edits += 1


def plan(episodes: Sequence[EditedEpisode]) -> list[Step]:
    """List what there is to learn, in order, without what was undone or deleted."""
    log, steps = surviving(episodes), []
    for episode, notes in episodes:
        late = _labelled_late(episode, notes)
        for event in (event for other, event in log if other is episode):
            if isinstance(event, Edited):
                steps.append(Step(episode, event))
            elif isinstance(event, Taught):
                frame_id = event.example.frame_id
                while late and late[0].example.frame_id < frame_id:
                    steps.append(Step(episode, late.pop(0)))
                if not notes.is_deleted(frame_id):
                    label = notes.relabel(frame_id) or event.example.label
                    example = event.example
                    if label is not example.label:
                        example = replace(example, label=label, point=None)
                    at_s = event.at_s if "timed" in episode.run else -1.0
                    steps.append(Step(episode, replace(event, example=example, at_s=at_s)))
        steps += [Step(episode, event) for event in late]
    return steps


def _labelled_late(episode: Episode, notes: Notes) -> list[Taught]:
    """List frames that were not examples while driving, but were labelled afterwards."""
    taught = {event.example.frame_id for _, event in episode.events if isinstance(event, Taught)}
    found = []
    for frame_id in episode.frames:
        label = notes.relabel(frame_id)
        if label and frame_id not in taught and not notes.is_deleted(frame_id):
            example = Example(frame_id=frame_id, label=label, is_intervention=False)
            found.append(Taught(example=example, x=np.zeros(0), at_s=-1.0))
    return found


def surviving(episodes: Sequence[EditedEpisode]) -> list[tuple[Episode, HistoryEvent]]:
    """Leave out what was undone while driving, also across the recordings of one run; what was
    undone of a recording before these stays undone."""
    log: list[tuple[Episode, HistoryEvent]] = []
    for episode, _ in episodes:
        for _, event in episode.events:
            if isinstance(event, Undone):
                gone = _gone(log, event, episode.run.get("run", ""))
                log = [one for i, one in enumerate(log) if i not in gone]
                if len(gone) >= max(1, len(event.frame_ids)):
                    continue
            log.append((episode, event))
    return log


def _gone(log: list[tuple[Episode, HistoryEvent]], event: Undone, run: str) -> set[int]:
    """Return the places of these examples of the run, or of the last edit of an image."""
    if not event.frame_ids:
        return set([i for i, (_, made) in enumerate(log) if isinstance(made, Edited)][-1:])
    frame_ids = set(event.frame_ids)
    return {
        i
        for i, (episode, made) in enumerate(log)
        if isinstance(made, Taught)
        and made.example.frame_id in frame_ids
        and episode.run.get("run", "") == run
    }


def learn_again(
    policy: Policy,
    episodes: Sequence[EditedEpisode],
    *,
    only: Callable[[Step], bool] = lambda step: True,
    on_step: Callable[[], None] = lambda: None,
) -> Report:
    """Teach the policy everything the recordings hold.

    Edits of learned images are repeated only where they apply to the same images: with the learner
    that was driven, and up to the first recording with edits. Others are counted as left out.
    ConfigurationError if a label is not one of the policy's moves.
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
    """Return the example with this policy's own vector; None if its picture was not recorded."""
    frame_id, label = event.example.frame_id, event.example.label
    if label not in policy.moves:
        raise ConfigurationError(
            f"{episode.id} teaches {label.value!r}, which is not one of the moves "
            f"{', '.join(policy.moves)}"
        )
    if frame_id in episode.frames:
        return replace(event, x=policy.extract(episode.frame(frame_id)))
    return event if event.x.size and episode.run.get("learner") == policy.name else None
