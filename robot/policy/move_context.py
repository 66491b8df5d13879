"""In which contexts an example counts: while the robot drives straight, and while it turns.

An example counts in the context of its own move. The first half second of a move counts in that of
the move before, too: this is what ends a move. After a pause nothing tells what went before, so the
first examples count in both.

Learned only from the labels and their teaching time, so that learning the same examples again
after an undo gives the same contexts.
"""

from __future__ import annotations

from robot.learner.part import Value
from robot.learner.values import name, number, optional
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import Lesson, PolicyPart, Seen
from robot.policy.pilot_pace import PAUSE_S
from robot.types import Action

STRAIGHT, TURNING = 0, 1
BOTH = (STRAIGHT, TURNING)
ONSET_S = 0.5
"""An example that comes so soon after a change of move counts in the old move's context, too."""


class MoveContext(PolicyPart):
    """Follows what is being taught, example by example.

    Args:
        kinds: Which moves are turns; where none is known to be, all contexts are one.
    """

    fields = (
        Value("move", optional(name)),
        Value("before", optional(name)),
        Value("since_s", number(0.0)),
        Value("last_s", number(0.0)),
    )

    def __init__(self, kinds: MoveKinds) -> None:
        self._kinds = kinds
        self._move: Action | None = None
        self._before: Action | None = None
        self._since_s = 0.0
        self._last_s = 0.0

    def on_frame(self, seen: Seen) -> None:
        seen.in_context = True
        if seen.under_way is not None:
            seen.context = self.of(seen.under_way)

    def on_example(self, lesson: Lesson) -> None:
        if lesson.is_learned:
            lesson.contexts = self.note(lesson.label, lesson.at_s)

    def of(self, move: Action) -> int:
        """Return the context that a move under way makes."""
        return TURNING if move in self._kinds.turns else STRAIGHT

    def note(self, label: Action, at_s: float | None) -> tuple[int, ...]:
        """Return the contexts in which an example counts.

        Args:
            label: Its label.
            at_s: Its teaching time; None: it stands for itself, and counts in both.
        """
        if at_s is None or not self._kinds.turns:
            self._move = None
            return BOTH
        before = self._move if 0.0 <= at_s - self._last_s <= PAUSE_S else None
        if before is not label:
            self._before, self._move, self._since_s = before, label, at_s
        self._last_s = at_s
        own = self.of(label)
        if at_s - self._since_s > ONSET_S or (
            self._before is not None and self.of(self._before) == own
        ):
            return (own,)
        return BOTH

    def restored(self) -> None:
        if self._since_s > self._last_s:
            raise ValueError(f"a move cannot last from {self._since_s} to {self._last_s} s")
