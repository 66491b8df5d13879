"""Hysteresis: when the robot ends its move for another, and which turn is barred meanwhile."""

from __future__ import annotations

import math
from collections.abc import Mapping

from robot.types import OPPOSITE, TURNS, Action

TURN_INERTIA, STRAIGHT_INERTIA = 0.3, 0.1
"""By how much the votes for another move must exceed those for the turn, or other move, under way.

People begin a turn late and end it late: between the two, the same view means go on as you do.
Votes alone cannot tell, and a robot without inertia ends its turns too early. A turn begun too late
costs more than one ended too late, so a turn has more of it (docs/explanation/learner.md).
"""
AHEAD_S = 0.075
"""With contexts another move is made once it has been ahead for so long. Each frame stands for the
time since the one before: one frame at ten a second, three at thirty. A camera that is three times
as fast would otherwise give chance three times as many opportunities to end a move. And when a move
begins, most of the averaged votes are those of the context that it has left."""
HEAD_START = 0.2
"""On the way straight that wait would come on top of the average's, with a wall ahead. So a turn
that has to wait begins to count while it has so many votes fewer than FORWARD."""


class Commitment:
    """Keeps the move under way unless the votes for another clearly exceed it.

    After a turn it bars the opposite turn until the robot has driven straight for long enough:
    LEFT and RIGHT alternating lead nowhere.

    Args:
        turn_inertia: By how much the votes for another move must exceed those for a turn under way.
        straight_inertia: The same for any other move under way.
        bars_opposite: False: a turn may follow its opposite.
    """

    def __init__(
        self,
        turn_inertia: float = TURN_INERTIA,
        straight_inertia: float = STRAIGHT_INERTIA,
        *,
        bars_opposite: bool = True,
    ) -> None:
        self.turn_inertia = turn_inertia
        self.straight_inertia = straight_inertia
        self.bars_opposite = bars_opposite
        self._turn: Action | None = None
        self._ahead_s = 0.0

    def choose(
        self,
        shares: Mapping[Action, float],
        under_way: Action | None = None,
        futile: Action | None = None,
        *,
        urge: float = 0.0,
        doubt: float = 0.0,
        hold: float = 1.0,
        stands_for_s: float = math.inf,
    ) -> Action:
        """Return the allowed action with most votes, the first on a tie; or the one under way.

        Args:
            shares: The votes for each move.
            under_way: The move that the robot makes while it drives itself, else None: the pilot's
                move must not influence a prediction that is compared with the pilot's move.
            futile: A move without effect: chosen only if there are no votes for another.
            urge: How much is subtracted from the votes of all turns.
            doubt: How much is subtracted from the votes of FORWARD.
            hold: How many times its inertia the move under way has.
            stands_for_s: The time that this frame stands for. The move under way goes on until
                others have been ahead for `AHEAD_S`; a futile one ends at once.
        """
        barred = OPPOSITE.get(self._turn) if self._turn is not None else None
        allowed = [action for action in shares if action is not barred] or list(shares)
        fruitful = [action for action in allowed if action is not futile and shares[action] > 0]
        inertia = hold * (self.turn_inertia if under_way in TURNS else self.straight_inertia)
        if under_way is Action.FORWARD and stands_for_s < AHEAD_S:
            urge -= HEAD_START
        chosen = max(
            fruitful or allowed,
            key=lambda action: (
                shares[action]
                + (inertia if action is under_way else 0.0)
                - (urge if action in TURNS else 0.0)
                - (doubt if action is Action.FORWARD else 0.0)
            ),
        )
        if under_way in shares and under_way is not futile and chosen is not under_way:
            self._ahead_s += stands_for_s
            if under_way is not None and self._ahead_s < AHEAD_S:
                return under_way
        self._ahead_s = 0.0
        if self.bars_opposite and chosen in TURNS:
            self._turn = chosen
        return chosen

    def free(self) -> None:
        """Allow every turn again: the last one is paid back."""
        self._turn = None
