"""Retraining from recordings: the recorded examples, with a person's edits applied.

The same examples in the same order make the same learner, bit for bit: pictures are stored as the
camera sent them, and examples that were undone while driving are left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from robot.errors import ConfigurationError
from robot.learner.base import Vector
from robot.policy.history import Edited, LogEvent, Taught, Undone, replay
from robot.policy.policy import Policy
from robot.store.episodes.edits import Notes
from robot.store.episodes.episode import Episode, EventEntry
from robot.store.models.model import same_nodes
from robot.types import Action, Example

EditedEpisode = tuple[Episode, Notes]
"""A recording with its edits."""
__all__ = ["EditedEpisode", "Report", "Step", "learn_again", "plan", "same_nodes"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One thing to learn: a labelled frame, with its vector if that was recorded, or an edit.

    `at_s` is the teaching time of the example; None for a frame that was labelled afterwards.
    `is_correction` is True if the pilot overruled the robot.
    """

    episode: Episode
    frame_id: int = 0
    label: Action | None = None
    x: Vector | None = None
    at_s: float | None = None
    is_correction: bool = False
    edit: Edited | None = None


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
    steps: list[Step] = []
    for episode, notes, entries in _surviving(episodes):
        extras = _untaught_relabels(episode, notes)
        for entry in entries:
            if isinstance(entry.event, Edited):
                steps.append(Step(episode=episode, edit=entry.event))
            elif isinstance(entry.event, Taught):
                frame_id = entry.event.example.frame_id
                while extras and extras[0] < frame_id:
                    steps.append(_extra(episode, notes, extras.pop(0)))
                if not notes.is_deleted(frame_id):
                    label = notes.relabel(frame_id) or entry.event.example.label
                    is_timed = "timed" in episode.run and entry.event.at_s >= 0.0
                    at_s = entry.event.at_s if is_timed else None
                    steps.append(
                        Step(
                            episode=episode,
                            frame_id=frame_id,
                            label=label,
                            x=entry.x,
                            at_s=at_s,
                            is_correction=entry.event.example.is_intervention,
                        )
                    )
        steps.extend(_extra(episode, notes, frame_id) for frame_id in extras)
    return steps


def _extra(episode: Episode, notes: Notes, frame_id: int) -> Step:
    return Step(episode=episode, frame_id=frame_id, label=notes.relabel(frame_id))


def _untaught_relabels(episode: Episode, notes: Notes) -> list[int]:
    """List frames that were not examples while driving, but were labelled afterwards."""
    taught = {e.event.example.frame_id for e in episode.events if isinstance(e.event, Taught)}
    return [
        frame_id
        for frame_id in episode.frames
        if frame_id not in taught and notes.relabel(frame_id) and not notes.is_deleted(frame_id)
    ]


def _surviving(
    episodes: Sequence[EditedEpisode],
) -> Iterator[tuple[Episode, Notes, list[EventEntry]]]:
    """Leave out what was undone while driving, also across the recordings of one run."""
    log: list[tuple[Episode, EventEntry]] = []
    for episode, _ in episodes:
        run = episode.run.get("run", "")
        for entry in episode.events:
            if isinstance(entry.event, Undone):
                log = _undo(log, run, entry.event)
            else:
                log.append((episode, entry))
    for episode, notes in episodes:
        yield episode, notes, [entry for other, entry in log if other is episode]


def _undo(
    log: list[tuple[Episode, EventEntry]], run: str, undone: Undone
) -> list[tuple[Episode, EventEntry]]:
    if not undone.frame_ids:
        edits = [i for i, (_, entry) in enumerate(log) if isinstance(entry.event, Edited)]
        return log[: edits[-1]] + log[edits[-1] + 1 :] if edits else log
    gone = set(undone.frame_ids)

    def stays(episode: Episode, entry: EventEntry) -> bool:
        event = entry.event
        return not (
            isinstance(event, Taught)
            and event.example.frame_id in gone
            and episode.run.get("run", "") == run
        )

    return [(episode, entry) for episode, entry in log if stays(episode, entry)]


def learn_again(
    policy: Policy,
    episodes: Sequence[EditedEpisode],
    *,
    skip: int = 0,
    only: Callable[[Step], bool] = lambda step: True,
    on_step: Callable[[], None] = lambda: None,
) -> Report:
    """Teach the policy everything the recordings hold.

    Edits of learned images are repeated only where they apply to the same images: with the learner
    that was driven, and recordings without edits. Otherwise they are counted as left out.

    Args:
        policy: What learns.
        episodes: Recordings, in order, each with its edits.
        skip: How many of the first steps the policy knows already.
        only: Returns True for a step that is to be learned.
        on_step: Called after each step.

    Raises:
        ConfigurationError: If a label is not one of the policy's moves.
    """
    is_faithful = all(
        episode.run.get("learner") == policy.name and not notes.edits for episode, notes in episodes
    )
    report = Report(taught=Counter())
    for step in (step for step in plan(episodes)[skip:] if only(step)):
        event = step.edit if step.edit is not None else _example_of(step, policy, report)
        if isinstance(event, Taught):
            replay(policy, [event], _raise)
            report.taught[event.example.label] += 1
        elif event is not None and is_faithful:
            replay(policy, [event], report.leave_out)
        elif event is not None:
            report.left_out_edits += 1
        on_step()
    return report


def _raise(event: LogEvent, error: Exception) -> None:
    raise error


def _example_of(step: Step, policy: Policy, report: Report) -> Taught | None:
    """Return the example with this policy's own vector; None if its picture was not recorded."""
    assert step.label is not None
    if step.label not in policy.moves:
        raise ConfigurationError(
            f"{step.episode.id} teaches {step.label.value!r}, which is not one of the moves "
            f"{', '.join(policy.moves)}"
        )
    if step.frame_id in step.episode.frames:
        x = policy.extract(step.episode.frame(step.frame_id))
    elif step.x is not None and step.episode.run.get("learner") == policy.name:
        x = step.x
    else:
        report.missing_frames += 1
        return None
    example = Example(frame_id=step.frame_id, label=step.label, is_intervention=step.is_correction)
    return Taught(example=example, x=x, at_s=-1.0 if step.at_s is None else step.at_s)
