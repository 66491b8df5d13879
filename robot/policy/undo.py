"""Takes back the last examples or the last edit, exactly.

Merging loses detail, so an example cannot be removed from a learner. Undo therefore restores a
snapshot of the `TrainingHistory`, and learns all later examples again except the undone examples.
Afterwards the learner is the same, bit for bit, as if the undone examples had never been taught.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from robot.policy.changes import replay
from robot.policy.events import DriveBegun, Edited, Taught, Undone
from robot.policy.history import TrainingHistory
from robot.types import Example


def last_examples(history: TrainingHistory, seconds: float) -> list[Taught]:
    """Return the examples that `undo_examples` would undo, oldest first."""
    since_s = history.teaching_s - seconds
    return [e for e in history.events if isinstance(e, Taught) and e.at_s > since_s]


def undo_examples(history: TrainingHistory, seconds: float) -> list[Example]:
    """Undo the last `seconds` of teaching (35 at most); return the undone examples.

    Edits made in this time stay, unless their image no longer exists. If a plugin refuses to learn
    the remaining examples again, nothing is undone and the plugin's error is raised.
    """
    gone = last_examples(history, seconds)
    if gone:
        _rebuild_without(history, gone)
        history.taught = history.taught - Counter(taught.example.label for taught in gone)
        kept_s = [e.at_s for e in history.events if not isinstance(e, DriveBegun)]
        history.teaching_s = max([history.snapshots[-1].at_s, *kept_s])
        history.tell(Undone(frame_ids=tuple(t.example.frame_id for t in gone)))
    return [taught.example for taught in gone]


def undo_edit(history: TrainingHistory) -> bool:
    """Undo the last edit, but never an example; return False if there is no edit to undo."""
    edits = [event for event in history.events if isinstance(event, Edited)]
    if edits:
        _rebuild_without(history, edits[-1:])
        history.tell(Undone(frame_ids=()))
    return bool(edits)


def _rebuild_without(history: TrainingHistory, dropped: list[Taught] | list[Edited]) -> None:
    """Restore the snapshot before the first of the `dropped` events, and replay all later events
    except the dropped ones."""
    snapshots = history.snapshots
    first = next(i for i, s in enumerate(snapshots) if dropped[0] in s.events)
    since, gone = snapshots[first:], {id(event) for event in dropped}
    again = [event for s in since for event in s.events if id(event) not in gone]
    with history.as_before_if_refused():
        history.policy.restore(since[0].state)
        replay(history.policy, again)
    snapshots[first:] = [replace(since[0], events=again)]
