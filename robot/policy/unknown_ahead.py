"""Notices that driving on leads into the unknown: the view grows less and less known.

A robot that has missed its turn drives towards what no example shows, such as a wall from near, and
there its votes are a guess. So FORWARD loses as many votes as novelty has risen. Only a rise
counts: in other light every view is novel, and no move would help. And only for a turn whose side
is clear: a guess is no way out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from robot.policy.progress_clock import passed_s
from robot.types import OPPOSITE, TURNS, Action

USUAL_S = 3.0
"""Novelty is compared with its average over about so long,"""
NOW_S = 0.15
"""and that itself is an average: single frames jump."""
MOST = 0.6
"""So many votes FORWARD loses at most."""
CLEARLY = 1.5
"""The side is clear if one turn has more than so many times the votes of its opposite."""


class UnknownAhead:
    """Follows the novelty of the views while the robot drives."""

    def __init__(self) -> None:
        self._now = self._usual = 0.0
        self._last_s: float | None = None

    def doubt(
        self,
        novelty: float,
        shares: Mapping[Action, float],
        under_way: Action | None,
        at_s: float,
    ) -> float:
        """Return how many votes FORWARD loses, from 0 to `MOST`.

        Args:
            novelty: Of the newest view; beyond 1 it is unknown.
            shares: The votes for each move.
            under_way: The move that the robot makes by its own choice; None if it does not.
            at_s: When the frame was taken.
        """
        if under_way is None or self._last_s is None:
            self._now = self._usual = novelty
        else:
            step_s = passed_s(self._last_s, at_s)
            self._now += (novelty - self._now) * -math.expm1(-step_s / NOW_S)
            self._usual += (novelty - self._usual) * -math.expm1(-step_s / USUAL_S)
        self._last_s = at_s
        if under_way is not Action.FORWARD or not _has_a_clear_side(shares):
            return 0.0
        return min(max(self._now - max(self._usual, 1.0), 0.0), MOST)

    def reset(self) -> None:
        """Forget the past: a new drive begins."""
        self._last_s = None


def _has_a_clear_side(shares: Mapping[Action, float]) -> bool:
    """Tell whether the votes say to which side a turn would be."""
    best = max((move for move in shares if move in TURNS), key=shares.__getitem__, default=None)
    return best is not None and shares[best] > CLEARLY * shares.get(OPPOSITE[best], 0.0)
