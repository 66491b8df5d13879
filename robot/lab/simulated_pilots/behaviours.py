"""Teachers of behaviours that the paper leaves to future work: follow a wall, follow a thing, push
a thing."""

from __future__ import annotations

import math

from robot.lab.simulated_pilots.situation import Situation
from robot.types import Action


class WallFollower:
    """Keeps a wall on its right, about 30 cm away, as precisely as turns about one wheel allow.

    The teacher measures the free distance at the right edge of the picture, 28 degrees from
    straight ahead. In this direction, a parallel wall that is 30 cm beside the robot is 64 cm away.
    """

    LOOK_RAD = math.radians(-28.0)
    NEAR_M, GOOD_M, FAR_M = 0.45, 0.62, 0.85
    AHEAD_NEAR_M, AHEAD_FREE_M = 0.30, 0.60
    ONWARDS_S = 0.8
    """Time for which the teacher drives straight after a turn, before it turns to the wall, in
    seconds. Otherwise the teacher would turn left and right forever at a gap in the wall."""

    def __init__(self) -> None:
        self._turning: Action | None = None
        self._turned_at_s = -math.inf

    def choose(self, situation: Situation) -> Action:
        aside_m, ahead_m = situation.range_at_m(self.LOOK_RAD), situation.free_ahead_m
        is_done = {
            None: False,
            Action.LEFT: ahead_m > self.AHEAD_FREE_M and aside_m > self.NEAR_M,
            Action.RIGHT: ahead_m < self.AHEAD_FREE_M or aside_m < self.GOOD_M,
        }
        if is_done[self._turning]:
            self._turning, self._turned_at_s = None, situation.at_s
        if self._turning is None:
            is_onwards = situation.at_s < self._turned_at_s + self.ONWARDS_S
            if ahead_m < self.AHEAD_NEAR_M or aside_m < self.NEAR_M * (0.7 if is_onwards else 0.9):
                self._turning = Action.LEFT
            elif aside_m > self.FAR_M and ahead_m > self.AHEAD_FREE_M + 0.1 and not is_onwards:
                self._turning = Action.RIGHT
        return self._turning or Action.FORWARD

    def tolerates(self, situation: Situation, action: Action) -> bool:
        """Return True for the teacher's current turn, and for FORWARD if there is room ahead."""
        if action is Action.FORWARD:
            return situation.free_ahead_m > 0.08 and not situation.is_pushing
        return action is self._turning


class Follower:
    """Follows the moving thing: turns to it, drives after it, and backs away when it is too near.

    The follower never stands still, because a stopped robot does not learn.
    """

    TURN_AT_RAD, GOOD_RAD = math.radians(16.0), math.radians(6.0)
    NEAR_M = 0.38

    def __init__(self) -> None:
        self._turning: Action | None = None

    def choose(self, situation: Situation) -> Action:
        target = situation.target
        if target is None:
            return Action.FORWARD
        bearing = target.bearing_rad
        if self._turning is not None and abs(bearing) < self.GOOD_RAD:
            self._turning = None
        if self._turning is None and abs(bearing) > self.TURN_AT_RAD:
            self._turning = Action.LEFT if bearing > 0 else Action.RIGHT
        if self._turning is None and target.distance_m < self.NEAR_M:
            return Action.BACKWARD
        return self._turning or Action.FORWARD

    def tolerates(self, situation: Situation, action: Action) -> bool:
        """Accept the move that this teacher would make. At the border between two moves, accept
        both."""
        target = situation.target
        if target is None or action is Action.STOP:
            return action is not Action.STOP
        if action is Action.FORWARD:
            return abs(target.bearing_rad) < 1.5 * self.TURN_AT_RAD
        if action is Action.BACKWARD:
            return target.distance_m < 1.2 * self.NEAR_M
        towards = Action.LEFT if target.bearing_rad > 0 else Action.RIGHT
        return action is towards or abs(target.bearing_rad) < self.GOOD_RAD


class Pusher(Follower):
    """Turns to the movable thing and pushes it to a wall."""

    TURN_AT_RAD, GOOD_RAD = math.radians(10.0), math.radians(4.0)
    NEAR_M = 0.0
