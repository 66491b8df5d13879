"""A teacher who steers by degrees: the nearer something is, the more."""

from __future__ import annotations

import math

from robot.devices.wheels import USUAL_THROTTLE
from robot.driver import CLASSIC, move_at
from robot.lab.simulated_pilots.situation import Situation
from robot.lab.simulated_pilots.teachers import Wanderer
from robot.types import Action, Point


class Steerer(Wanderer):
    """Drives where there is room, in curves: begins to steer far off, and turns hard when near.

    To which side, and what it lets the robot do, is as of `Wanderer`; the hand does not jerk.

    Args:
        turns: The turns it uses.
        is_cut: The body takes moves alone: what is meant is cut to them.

    Attributes:
        point: What it meant by the move that it chose last; None if that is cut.
    """

    FAR_M, NEAR_M = 0.45, 0.12
    """Begins to steer with less free way than this, and steers fully with less than that."""
    LAG_S = 0.3
    """Time constant of the hand."""

    def __init__(self, turns: tuple[Action, ...], *, is_cut: bool = False) -> None:
        super().__init__(turns)
        self.point: Point | None = None
        self._is_cut = is_cut
        self._steering, self._at_s = 0.0, -math.inf

    def choose(self, situation: Situation) -> Action:
        """Return the move that its steering counts as."""
        share = (self.FAR_M - situation.free_ahead_m) / (self.FAR_M - self.NEAR_M)
        if share <= 0.0:
            self._turning = None
        elif self._turning is None:
            self._turning = self._choose_turn(situation)
        side = {Action.LEFT: -1.0, Action.RIGHT: 1.0, None: 0.0}[self._turning]
        wanted = side * min(max(share, 0.0), 1.0)
        kept = math.exp((self._at_s - situation.at_s) / self.LAG_S)
        self._at_s = situation.at_s
        self._steering = wanted + kept * (self._steering - wanted)
        point = Point(self._steering, USUAL_THROTTLE)
        self.point = None if self._is_cut else point
        return move_at(point, CLASSIC.values()) or Action.FORWARD

    def tolerates(self, situation: Situation, action: Action) -> bool:
        return super().tolerates(situation, action) and not situation.is_pushing
