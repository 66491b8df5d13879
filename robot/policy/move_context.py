"""In which contexts an example counts: while the robot drives straight, and while it turns.

An example counts in the context of its own move. The first half second of a move counts in that of
the move before, too: this is what ends a move. After a pause nothing tells what went before, so the
first examples count in both.

Learned only from the labels and their teaching time, so that learning the same examples again
after an undo gives the same contexts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from robot.policy.move_kinds import MoveKinds
from robot.policy.pilot_pace import PAUSE_S
from robot.types import Action

STRAIGHT, TURNING = 0, 1
BOTH = (STRAIGHT, TURNING)
ONSET_S = 0.5
"""An example that comes so soon after a change of move counts in the old move's context, too."""


class MoveContext:
    """Follows what is being taught, example by example.

    Args:
        kinds: Which moves are turns; where none is known to be, all contexts are one.
    """

    def __init__(self, kinds: MoveKinds) -> None:
        self._turns = kinds.turns
        self._move: Action | None = None
        self._before: Action | None = None
        self._since_s = 0.0
        self._last_s = 0.0

    def of(self, move: Action) -> int:
        """Return the context that a move under way makes."""
        return TURNING if move in self._turns else STRAIGHT

    def note(self, label: Action, at_s: float | None) -> tuple[int, ...]:
        """Return the contexts in which an example counts.

        Args:
            label: Its label.
            at_s: Its teaching time; None: it stands for itself, and counts in both.
        """
        if at_s is None or not self._turns:
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

    def get_state(self) -> dict[str, Any]:
        """Return all of it as plain values."""
        return {
            "move": self._move,
            "before": self._before,
            "since_s": self._since_s,
            "last_s": self._last_s,
        }

    def set_state(self, values: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned.

        Raises:
            ValueError: If it does not belong to this class.
        """
        move, before = values["move"], values["before"]
        since_s, last_s = float(values["since_s"]), float(values["last_s"])
        if not 0.0 <= since_s <= last_s < math.inf:
            raise ValueError(f"a move cannot last from {since_s} to {last_s} s")
        self._move = None if move is None else Action(move)
        self._before = None if before is None else Action(before)
        self._since_s, self._last_s = since_s, last_s
