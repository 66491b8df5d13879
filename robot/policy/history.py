"""Event-sourced training history with snapshots, so that recent training can be undone exactly.

Merging loses detail, so an example cannot be removed from a learner. Instead the log keeps the last
minute's events and snapshots of the learner: undo goes back to a snapshot and learns all examples
again except those to be removed. Afterwards the learner is bit for bit as if
the undone examples had never been.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from robot.driver import Move
from robot.learner.base import State, Vector
from robot.policy.policy import Policy
from robot.types import Action, Example

SNAPSHOT_EVERY_S = 10.0
"""Teaching time between snapshots, in seconds: an undo relearns at most this much extra."""
UNDO_HORIZON_S = 35.0
"""Teaching time that is kept for undoing."""
_LONGEST_STEP_S = 0.5
"""Longest gap between two examples that counts as teaching, in seconds; a longer one is a pause."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Taught:
    """One example with the vector that was learned and the teaching time at which it was."""

    example: Example
    x: Vector
    at_s: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edited:
    """One change that a person made: `relabel`, `delete` or `pin` of a learned image; or with node
    0 `outdate` of all that was taught before, or `alike`: left and right are alike here."""

    verb: str
    node_id: int
    value: Any
    at_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Undone:
    """Examples that were taken back, or with no frame ids the last edit."""

    frame_ids: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Replaced:
    """Another policy replaced the one before: a loaded model, another size."""

    policy_name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveBegun:
    """The policy was reset between two examples: some learners look for their place then."""

    at_s: float


LogEvent = Taught | Edited | DriveBegun
"""Events that make up a learner: replaying them in order gives the same one, bit for bit."""
HistoryEvent = Taught | Edited | Undone | Replaced


@dataclass(frozen=True, slots=True, kw_only=True)
class _Snapshot:
    """The policy's state at a teaching time, and what was made until the next snapshot."""

    at_s: float
    state: State
    events: list[LogEvent] = field(default_factory=list)


class TrainingHistory:
    """Teaches a policy, and can take the last examples back.

    Args:
        policy: The policy that learns. From now on only the history may change it.
        on_event: Called with everything that changes the learner, in order, to be written down.
        declared: The body's descriptions of its moves, which each policy here gets.
    """

    def __init__(
        self,
        policy: Policy,
        on_event: Callable[[HistoryEvent], None] | None = None,
        declared: Collection[Move] = (),
    ) -> None:
        self.declared = declared
        self._on_event = on_event or (lambda event: None)
        self.changes = 0
        """How often the learner was changed, in any way; it only grows. Any thread may read it:
        when a request that changes the learner has returned, the change is counted."""
        self.drives = 0
        """How often a drive was begun after something was taught; it only grows."""
        self._begin(policy, Counter())

    def _begin(self, policy: Policy, taught: Counter[Action]) -> None:
        self.policy = policy
        self._is_ours = all(
            type(part).__module__.startswith("robot.") for part in (policy.learner, policy.features)
        )
        policy.kinds.describe(self.declared)
        self.taught = taught
        self._is_drive_new = True
        self.teaching_s = 0.0
        """Teaching time of the last example: pauses longer than half a second count as that."""
        self._last_example_s: float | None = None
        self._snapshots = [_Snapshot(at_s=0.0, state=policy.get_state())]

    @property
    def _events(self) -> list[LogEvent]:
        """The events that can be undone, as a log."""
        return [event for snapshot in self._snapshots for event in snapshot.events]

    @property
    def n_examples(self) -> int:
        """Number of examples that the learner holds."""
        return self.taught.total()

    def teach(self, example: Example, x: Vector, captured_s: float) -> None:
        """Have the policy learn one labelled frame that was taken at `captured_s`; one that it
        refuses, whatever a plugin raises, leaves no trace."""
        step_s = captured_s - self._last_example_s if self._last_example_s is not None else 0.0
        teaching_s = self.teaching_s + min(max(step_s, 0.0), _LONGEST_STEP_S)
        event = Taught(example=example, x=x, at_s=teaching_s)
        with self._as_before_if_refused():
            _make(self.policy, event)
        self._last_example_s, self.teaching_s = captured_s, teaching_s
        self.taught[example.label] += 1
        self._record(event)
        if self.teaching_s - self._snapshots[-1].at_s >= SNAPSHOT_EVERY_S:
            self._take_snapshot()

    def begin_drive(self) -> None:
        """Reset the policy, because a drive ends here and another will begin."""
        self.policy.reset()
        if not self._is_drive_new:
            self._snapshots[-1].events.append(DriveBegun(at_s=self.teaching_s))
            self._is_drive_new = True
            self.drives += 1

    def edit(self, verb: str, node_id: int = 0, value: Any = None) -> None:
        """Relabel (`value`: an Action), delete, or pin (`value`: a bool) one learned image, or
        outdate all that was taught before; or say whether left and right are `alike` (a bool).

        Raises:
            LookupError: If there is no such image.
            ValueError: If the verb is unknown or the policy refuses.
        """
        event = Edited(verb=verb, node_id=node_id, value=value, at_s=self.teaching_s)
        with self._as_before_if_refused():
            _make(self.policy, event)
        self._record(event)

    def last_examples(self, seconds: float) -> list[Taught]:
        """Return the examples of the last `seconds` of teaching, oldest first: what undo drops."""
        since_s = self.teaching_s - seconds
        return [e for e in self._events if isinstance(e, Taught) and e.at_s > since_s]

    def undo(self, seconds: float) -> list[Example]:
        """Un-learn the last `seconds` of teaching (35 at most); return the examples that are gone.

        Edits made in that time stay, unless the image they were made to is no longer there. Where a
        plugin refuses to learn the others again nothing is undone, and its error is raised.
        """
        gone = self.last_examples(seconds)
        if gone:
            self._rebuild_without(gone)
            self.taught = self.taught - Counter(taught.example.label for taught in gone)
            kept_s = [e.at_s for e in self._events if not isinstance(e, DriveBegun)]
            self.teaching_s = max([self._snapshots[-1].at_s, *kept_s])
            self._tell(Undone(frame_ids=tuple(t.example.frame_id for t in gone)))
        return [taught.example for taught in gone]

    def undo_edit(self) -> bool:
        """Take the last edit back, keeping every example; False if there is none to take back."""
        edits = [event for event in self._events if isinstance(event, Edited)]
        if edits:
            self._rebuild_without(edits[-1:])
            self._tell(Undone(frame_ids=()))
        return bool(edits)

    def replace_policy(self, policy: Policy, taught: Counter[Action] | None = None) -> None:
        """Go on with another policy; what was taught to the one before cannot be undone here."""
        self._begin(policy, Counter(taught or {}))
        self._tell(Replaced(policy_name=policy.name))

    @contextlib.contextmanager
    def _as_before_if_refused(self) -> Iterator[None]:
        """Undo what a plugin did before it refused the rest. Ours refuse before they do anything,
        and a copy takes as long as an example."""
        before = None if self._is_ours else self.policy.get_state()
        try:
            yield
        except Exception:
            if before is not None:
                self.policy.restore(before)
            raise

    def _record(self, event: Taught | Edited) -> None:
        self._snapshots[-1].events.append(event)
        self._is_drive_new = False
        self._tell(event)

    def _tell(self, event: HistoryEvent) -> None:
        self.changes += 1
        self._on_event(event)

    def _rebuild_without(self, dropped: list[Taught] | list[Edited]) -> None:
        """Go back to a snapshot before the first dropped event, and learn the others again."""
        first = next(i for i, s in enumerate(self._snapshots) if dropped[0] in s.events)
        since, gone = self._snapshots[first:], {id(event) for event in dropped}
        again = [event for s in since for event in s.events if id(event) not in gone]
        with self._as_before_if_refused():
            self.policy.restore(since[0].state)
            replay(self.policy, again)
        self._snapshots[first:] = [replace(since[0], events=again)]

    def _take_snapshot(self) -> None:
        """Remember the learner as it is, and forget what no undo can reach any more."""
        self._snapshots.append(_Snapshot(at_s=self.teaching_s, state=self.policy.get_state()))
        while self._snapshots[1].at_s <= self.teaching_s - UNDO_HORIZON_S:
            self._snapshots.pop(0)


def replay(
    policy: Policy,
    events: Iterable[LogEvent],
    on_refused: Callable[[LogEvent, Exception], None] | None = None,
) -> None:
    """Make these changes again, in order: undo, recovery and training from recordings all do.

    Args:
        policy: The policy that learns.
        events: The changes. An example of no known teaching time has a negative one.
        on_refused: Called for a change that cannot be made here; None: edits are left out. An
            edit's image may never have come to be, or be pinned, where other examples are missing.
    """
    for event in events:
        try:
            _make(policy, event)
        except (LookupError, ValueError) as error:
            if on_refused is not None:
                on_refused(event, error)
            elif not isinstance(event, Edited):
                raise


def _make(policy: Policy, event: LogEvent) -> None:
    if isinstance(event, Taught):
        example, at_s = event.example, event.at_s if event.at_s >= 0.0 else None
        policy.learn(event.x, example.label, at_s, example.point)
    elif isinstance(event, DriveBegun):
        policy.reset()
    elif event.verb == "relabel":
        policy.relabel_node(event.node_id, Action(event.value))
    elif event.verb == "delete":
        policy.learner.delete_node(event.node_id)
    elif event.verb == "pin":
        policy.learner.pin_node(event.node_id, bool(event.value))
    elif event.verb == "outdate":
        policy.learner.outdate()
    elif event.verb == "alike":
        policy.set_alike(bool(event.value))
    else:
        known = "relabel, delete, pin, outdate, alike"
        raise ValueError(f"unknown edit {event.verb!r}; known: {known}")
