"""Event-sourced training history: the events that can be undone, with snapshots of the learner.

`undo.py` undoes recent events exactly.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from robot.learner.base import State, Vector
from robot.moves import Move
from robot.policy.changes import make
from robot.policy.events import DriveBegun, Edited, HistoryEvent, LogEvent, Replaced, Taught
from robot.policy.policy import Policy
from robot.types import Action, Example

SNAPSHOT_EVERY_S = 10.0
"""Teaching time between two snapshots, in seconds; an undo learns at most this much again."""
UNDO_HORIZON_S = 35.0
"""Teaching time that can be undone, in seconds."""
_LONGEST_STEP_S = 0.5
"""Maximum teaching time between two examples, in seconds. A longer gap counts as a pause."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """The policy's state at the teaching time `at_s`, and the events up to the next snapshot."""

    at_s: float
    state: State
    events: list[LogEvent] = field(default_factory=list)


class TrainingHistory:
    """Teaches a policy, and keeps what undo needs.

    Args:
        policy: The policy that learns. From now on only the history may change the policy.
        on_events: Called with the events that change the learner, in order.
        declared: How the body describes its moves; each policy gets these descriptions.
    """

    def __init__(
        self,
        policy: Policy,
        on_events: Callable[[Sequence[HistoryEvent]], None] | None = None,
        declared: Collection[Move] = (),
    ) -> None:
        self.declared = declared
        self._on_events = on_events or (lambda events: None)
        self.changes = 0
        """Number of changes of the learner; any thread may read it, and it never decreases. A
        change is counted before its request is answered."""
        self.edits = 0
        """Number of changes that are not examples; it never decreases."""
        self.drives = 0
        """Number of drives begun after an example was taught; it never decreases."""
        self._begin(policy, Counter())

    def _begin(self, policy: Policy, taught: Counter[Action]) -> None:
        self.policy = policy
        self._is_ours = all(
            type(part).__module__.startswith("robot.") for part in (policy.learner, policy.features)
        )
        self.batch = 64 if self._is_ours else 1
        """Frames per call of `teach_all`; 1 for plugins, so that errors affect only one example."""
        policy.kinds.describe(self.declared)
        self.taught = taught
        self._is_drive_new = True
        self.teaching_s = 0.0
        """Teaching time up to the last example; a pause counts as at most half a second."""
        self._last_example_s: float | None = None
        self.snapshots = [Snapshot(at_s=0.0, state=policy.get_state())]

    @property
    def events(self) -> list[LogEvent]:
        """The events that can be undone, oldest first."""
        return [event for snapshot in self.snapshots for event in snapshot.events]

    def teach(self, example: Example, x: Vector, captured_s: float) -> None:
        """Teach one labelled frame, taken at `captured_s`. If this fails, nothing has changed."""
        self.teach_all([(example, x, captured_s)])

    def teach_all(self, lessons: Iterable[tuple[Example, Vector, float]]) -> Sequence[Taught]:
        """Teach several frames in order, with the same result as `teach`; return the events."""
        last_s, at_s, events = self._last_example_s, self.teaching_s, []
        for example, x, captured_s in lessons:
            step_s = captured_s - last_s if last_s is not None else 0.0
            last_s, at_s = captured_s, at_s + min(max(step_s, 0.0), _LONGEST_STEP_S)
            events.append(Taught(example=example, x=x, at_s=at_s))
        with self.as_before_if_refused():
            self.policy.learn_all([(e.x, e.example.label, e.at_s, e.example.point) for e in events])
        self._last_example_s, self.teaching_s = last_s, at_s
        self.taught.update(event.example.label for event in events)
        self._record(events)
        if self.teaching_s - self.snapshots[-1].at_s >= SNAPSHOT_EVERY_S:
            self._take_snapshot()
        return events

    def begin_drive(self) -> None:
        """Reset the policy, because one drive ends here and the next will begin."""
        self.policy.reset()
        if not self._is_drive_new:
            self.snapshots[-1].events.append(DriveBegun(at_s=self.teaching_s))
            self._is_drive_new = True
            self.drives += 1

    def edit(self, verb: str, node_id: int = 0, value: Any = None) -> None:
        """Make one edit: `relabel`, `delete`, `pin`, `outdate` or `alike` (see `Edited`). `value`
        is an Action for `relabel`, and a bool for `pin` and `alike`.

        Raises:
            LookupError: If there is no such image.
            ValueError: If the verb is unknown or the policy refuses.
        """
        event = Edited(verb=verb, node_id=node_id, value=value, at_s=self.teaching_s)
        with self.as_before_if_refused():
            make(self.policy, event)
        self._record([event])

    def replace_policy(self, policy: Policy, taught: Counter[Action] | None = None) -> None:
        """Continue with another policy; earlier examples can no longer be undone."""
        self._begin(policy, Counter(taught or {}))
        self.tell(Replaced(policy_name=policy.name))

    @contextlib.contextmanager
    def as_before_if_refused(self) -> Iterator[None]:
        """If a plugin changes the state and then raises an error, restore the state. The state of
        built-in learners is not copied, because they raise errors before any change, and a copy
        takes as long as learning an example."""
        before = None if self._is_ours else self.policy.get_state()
        try:
            yield
        except Exception:
            if before is not None:
                self.policy.restore(before)
            raise

    def _record(self, events: Sequence[Taught | Edited]) -> None:
        self.snapshots[-1].events.extend(events)
        self._is_drive_new = False
        self.tell(*events)

    def tell(self, *events: HistoryEvent) -> None:
        """Count the changes, and report them."""
        self.changes += len(events)
        self.edits += sum(not isinstance(event, Taught) for event in events)
        self._on_events(events)

    def _take_snapshot(self) -> None:
        """Take a snapshot of the learner, and drop the snapshots that no undo needs any more."""
        self.snapshots.append(Snapshot(at_s=self.teaching_s, state=self.policy.get_state()))
        while self.snapshots[1].at_s <= self.teaching_s - UNDO_HORIZON_S:
            self.snapshots.pop(0)
