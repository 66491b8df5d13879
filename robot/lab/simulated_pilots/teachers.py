"""Simulated teachers, which choose the moves of simulated pilots.

A teacher looks at a situation, chooses a move, and decides which moves of the robot it tolerates.
Human delays and errors are in `hand.py`, and the takeover rules in `pilot.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from robot.devkit.wheels import USUAL_THROTTLE
from robot.driver import Pose
from robot.lab.simulated_pilots.situation import Situation
from robot.moves import CLASSIC, move_at
from robot.types import Action, Point


class Teacher(Protocol):
    """Protocol of a teacher, which may come from a user's own file.

    A teacher who steers proportionally has a `point`: the steering and throttle of its last move.
    """

    def choose(self, situation: Situation) -> Action:
        """Return the move that this teacher makes. The pilot calls this method each time it looks
        at the screen. `situation.at_s` never decreases.

        The pilot may look at a picture twice, or never.
        """
        ...

    def tolerates(self, situation: Situation, action: Action) -> bool:
        """Return True if the robot may make this move. Called at each look while the robot
        drives."""
        ...


class SonarController:
    """The paper's self-training: it turns left for two seconds if the sonar reads less than 20 cm
    or the robot bumps, and else drives forward.

    Source: FLAIRS-30, 2017, section on self-training.
    """

    NEAR_M = 0.20
    TURN_S = 2.0

    def __init__(self) -> None:
        self._turns_until_s = 0.0

    def choose(self, situation: Situation) -> Action:
        if situation.at_s >= self._turns_until_s - 1e-9 and (
            situation.distance_m < self.NEAR_M or situation.bumped
        ):
            self._turns_until_s = situation.at_s + self.TURN_S
        return Action.LEFT if situation.at_s < self._turns_until_s - 1e-9 else Action.FORWARD

    def tolerates(self, situation: Situation, action: Action) -> bool:
        return True


_SIDES = {Action.LEFT: 1, Action.RIGHT: -1}


@dataclass(frozen=True, slots=True, kw_only=True)
class TeacherParams:
    """How a teacher drives: the distances at which it turns and drives on, in metres."""

    turn_at_m: float = 0.22
    """If the free distance ahead is below `turn_at_m`, the teacher turns."""
    go_at_m: float = 0.45
    """A turn ends when the free distance ahead exceeds `go_at_m`."""
    danger_m: float = 0.06
    """If the free distance ahead is below `danger_m`, the teacher takes control from a robot that
    drives forward."""
    left_at: tuple[str, ...] = ()
    right_at: tuple[str, ...] = ()
    """The teacher turns left at the things in `left_at`, right at those in `right_at`, and the
    shorter way at all other things."""


class Wanderer:
    """Drives forward until something is near, and then turns until the way is free.

    Args:
        turns: The turns that the teacher may make: LEFT, RIGHT or both. If both are allowed, the
            teacher chooses the shorter one and keeps to it until the way is free.
    """

    LONG_TURN_S = 8.0
    """Duration of a turn, in seconds, after which the place counts as narrow. The teacher has then
    turned by 150 degrees. In a narrow place, it drives on with less free distance."""
    STUCK_S, STUCK_M = 13.0, 0.15
    """A robot that has stayed within `STUCK_M` metres for `STUCK_S` seconds counts as stuck.
    Turning round on the spot takes less time."""

    def __init__(
        self,
        turns: tuple[Action, ...] = (Action.LEFT, Action.RIGHT),
        params: TeacherParams | None = None,
    ) -> None:
        self.params = params or TeacherParams()
        self._turns = {_SIDES[turn]: turn for turn in turns}
        self._turning: Action | None = None
        self._turning_since_s = 0.0
        self._anchor: Pose | None = None
        self._anchored_s = 0.0

    def choose(self, situation: Situation) -> Action:
        free_m = situation.free_ahead_m
        if self._turning is None and free_m < self.params.turn_at_m:
            self._turning = self._choose_turn(situation)
            self._turning_since_s = situation.at_s
        elif self._turning is not None and free_m > self._enough_m(situation.at_s):
            self._turning = None
        return self._turning or Action.FORWARD

    def tolerates(self, situation: Situation, action: Action) -> bool:
        """Reject needless turns, wrong turns, standing still, and driving on in tight places."""
        if action is Action.STOP or self._is_stuck(situation):
            return False
        if action is Action.FORWARD:
            return situation.free_ahead_m > self.params.danger_m and not situation.is_pushing
        if self._turning is not None:
            return action is self._turning
        has_habit = situation.ahead in self.params.left_at + self.params.right_at
        if has_habit and action is not self._choose_turn(situation):
            return False
        return situation.free_ahead_m < 1.3 * self.params.go_at_m

    def _is_stuck(self, situation: Situation) -> bool:
        pose = situation.pose
        if self._anchor is None or (
            math.hypot(pose.x_m - self._anchor.x_m, pose.y_m - self._anchor.y_m) > self.STUCK_M
        ):
            self._anchor, self._anchored_s = pose, situation.at_s
        return situation.at_s - self._anchored_s > self.STUCK_S

    def _enough_m(self, now_s: float) -> float:
        if now_s - self._turning_since_s > self.LONG_TURN_S:
            return self.params.turn_at_m + 0.05
        return self.params.go_at_m

    def _choose_turn(self, situation: Situation) -> Action:
        """Follow the habit; if there is none, choose the side that needs less turning."""
        for side, habit in ((1, self.params.left_at), (-1, self.params.right_at)):
            if situation.ahead in habit and side in self._turns:
                return self._turns[side]
        return self._turns[
            min(
                self._turns,
                key=lambda side: (
                    situation.turn_needed_rad(side, self.params.go_at_m),
                    -situation.room_m(side),
                ),
            )
        ]


class Steerer(Wanderer):
    """Drives in curves if there is room: steers slightly at far things, and hard at near things.

    The teacher chooses the side of a turn and tolerates moves as a `Wanderer` does. Its steering
    changes gradually.

    Args:
        is_cut: True if the body accepts only moves; the steering is then rounded to a move.

    Attributes:
        point: Steering and throttle that the last call of `choose` computed; None if the body
            accepts only moves (`is_cut`).
    """

    FAR_M, NEAR_M = 0.45, 0.12
    """The teacher begins to steer if the free distance is below `FAR_M`, and steers fully below
    `NEAR_M`, in metres."""
    LAG_S = 0.3
    """Time constant of the hand, in seconds."""

    def __init__(self, turns: tuple[Action, ...], *, is_cut: bool = False) -> None:
        super().__init__(turns)
        self.point: Point | None = None
        self._is_cut = is_cut
        self._steering, self._at_s = 0.0, -math.inf

    def choose(self, situation: Situation) -> Action:
        """Return the move that is nearest to the steering that this teacher wants."""
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


SHELVES = ("east wall", "west wall")
WALLS = ("south wall", "north wall")
"""The walls of the office. Dark shelves stand along `SHELVES`; `WALLS` are light."""

TEACHER_PARAMS: dict[str, TeacherParams] = {
    "usual": TeacherParams(),
    "early": TeacherParams(turn_at_m=0.35, go_at_m=0.55, danger_m=0.10),
    "late": TeacherParams(turn_at_m=0.14, go_at_m=0.35, danger_m=0.04),
    "wide": TeacherParams(go_at_m=1.0),
    "habit": TeacherParams(left_at=WALLS, right_at=SHELVES),
}
"""Parameters of the simulated teachers, by name."""
