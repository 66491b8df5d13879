"""Detects a stalled robot: motion is commanded, the image does not change.

A pilot seldom lets it come to that, so no example shows the view from there, and votes alone would
push on for ever, or brake. An image that does not change shows it, or a bumper where there is one.
From one frame to the next a car that sets off changes it as little as one that stands; so in the
end it must still be as it was when that began.

A turn is not watched here: near a plain wall it changes the picture little (`Headway` watches it).
Nor is a move that nobody knows, if the pilot has stood with it himself: he may wait, or grip.
"""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from robot.policy.move_kinds import MoveKinds
from robot.types import DEFAULT_MOVES, Action, Point

STUCK_S = 0.5
"""After so long without effect a move is given up, if the pilot never meant to push,"""
AWAY_S = 1.5
"""Nor is it taken up again for so long, nor before the robot moves: one after the other may be."""
STEP_S = 0.1
_STILL_SHARE = 0.25
MEMORY, _FEWEST = 100, 5


class ChangeMeter:
    """How much the picture changes within a tenth of a second, and usually, driving straight.

    Turns say nothing of the latter: where a turn is quick or the place is wide, driving straight
    would look still beside it.

    Attributes:
        changes: The latest changes of a straight drive; their median is the usual one.
    """

    def __init__(self) -> None:
        self.changes: deque[float] = deque(maxlen=MEMORY)
        self.before: NDArray[np.uint8] | None = None
        self.before_s = 0.0

    def note(self, picture: NDArray[np.uint8], at_s: float) -> float | None:
        """Compare a picture with the one of a tenth of a second before; None: that is not over yet.

        Args:
            picture: The frame in grey, of any one shape.
            at_s: When the frame was taken.
        """
        before, step_s = self.before, at_s - self.before_s
        if before is not None and 0.0 <= step_s < 0.9 * STEP_S:
            return None
        self.before, self.before_s = picture, at_s
        if before is None or before.shape != picture.shape or step_s < 0.0:
            return None
        return difference(picture, before)

    @property
    def is_known(self) -> bool:
        """True as soon as it has seen enough of a straight drive."""
        return len(self.changes) >= _FEWEST

    def is_still(self, change: float) -> bool:
        """Tell whether a change is so small that the body stands; False before it has driven."""
        return self.is_known and change < _STILL_SHARE * statistics.median(self.changes)

    def add(self, change: float) -> None:
        """Add the change between two pictures of a straight drive, unless the body stood."""
        if not self.is_still(change):
            self.changes.append(change)

    def reset(self) -> None:
        """Compare the next picture with none."""
        self.before = None


def difference(picture: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    """Return by how much two pictures of one shape differ, in grey levels a pixel."""
    return float(np.abs(picture.astype(np.int16) - other).mean())


PAYS_BACK = 4.0
"""A second of driving straight pays for so many seconds of turning."""
EFFECT_S = 0.2
"""A straight move pays from here on: sooner nobody can tell if it has an effect."""
STRAIGHT_S = 0.3
"""Turns are paid back after driving straight for so long, and as long as the clock wants."""
_LONGEST_STEP_S = 0.25


class Headway:
    """What a body, the pilot's or the robot's, has done since it last got on.

    Turning either way, and pushing without effect, add to a debt in seconds; driving straight with
    effect takes four times as much off; it is never below 0. A curve by degrees gets on by what it
    lacks to full lock, and pays for as much turning. Changes from one side to the other count until
    the debt is paid.

    Args:
        kinds: Which moves are turns, and to which side.

    Attributes:
        debt_s: The debt.
        side: The side that it turned to last; None since the debt was paid.
        sides_s: When it changed sides, the last two times.
    """

    def __init__(self, kinds: MoveKinds) -> None:
        self._kinds = kinds
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self.debt_s = self._straight_s = 0.0
        self._last_s: float | None = None
        self._free()

    def _free(self) -> None:
        self.side: float | None = None
        self.sides_s: list[float] = []

    def note(
        self, action: Action, at_s: float, point: Point | None = None, *, is_stalled: bool = False
    ) -> None:
        """Update the debt by the move that has been under way since the last call.

        Args:
            action: The move; STOP changes nothing.
            at_s: Now, in seconds.
            point: The move by degrees, if it was driven so.
            is_stalled: True if it has no effect.
        """
        last_s, self._last_s = self._last_s, at_s
        step_s = 0.0 if last_s is None else min(max(at_s - last_s, 0.0), _LONGEST_STEP_S)
        if action in self._kinds.turns or is_stalled:
            turned = 1.0 if point is None or is_stalled else abs(point.steering)
            self.debt_s = max(0.0, self.debt_s + (2.0 * turned - 1.0) * step_s)
            self._straight_s = 0.0
        elif action is not Action.STOP:
            self._straight_s += step_s
            if self._straight_s > EFFECT_S:
                self.debt_s = max(0.0, self.debt_s - PAYS_BACK * step_s)
        if self.debt_s == 0.0 and self._straight_s >= STRAIGHT_S:
            self._free()

    def turn(self, action: Action, at_s: float) -> None:
        """Take note of a move, and of when it changed sides."""
        side = self._kinds.turns.get(action)
        if side is not None:
            if self.side == -side:
                self.sides_s = [*self.sides_s[-1:], at_s]
            self.side = side

    @property
    def clock(self) -> tuple[float, float, float | None]:
        """Debt, time straight with effect, and the time of the last call."""
        return self.debt_s, self._straight_s, self._last_s

    @clock.setter
    def clock(self, values: tuple[float, float, float | None]) -> None:
        self.debt_s, self._straight_s, self._last_s = values


class StallDetector:
    """Bars a move that has no effect.

    Args:
        kinds: Which moves are which.

    Attributes:
        patience_s: How long a move may be without effect: more for a pilot who pushes things on
            purpose (`pilot_pace.py`).
        is_stalled: True while a move under way has no effect.
        futile: The moves that are given up.
    """

    def __init__(self, kinds: MoveKinds | None = None) -> None:
        self.patience_s = STUCK_S
        self.is_stalled = False
        self._kinds = kinds or MoveKinds(DEFAULT_MOVES)
        self._meter = ChangeMeter()
        self._stuck_since: tuple[float, NDArray[np.uint8]] | None = None
        self.futile: list[Action] = []
        self._barred_until_s = 0.0

    def barred(
        self,
        picture: NDArray[np.uint8],
        under_way: Action | None,
        at_s: float,
        *,
        bumped: bool = False,
        taught: ChangeMeter | None = None,
        stands: Collection[Action] = (),
    ) -> Action | None:
        """Look at one more frame; return the move that was given up last, if it still is.

        Args:
            picture: The frame in grey, of any one shape.
            under_way: The move that the robot makes by its own choice; None if it does not.
            at_s: When the frame was taken.
            bumped: True if a bumper is pressed.
            taught: How much the picture changed as the pilot drove straight; None or too little of
                it: as the robot itself did.
            stands: Moves that may be without effect.
        """
        change = self._meter.note(picture, at_s)
        if change is not None:
            kinds = self._kinds
            if under_way in kinds.measured:
                self._meter.add(change)
            scale = taught if taught is not None and taught.is_known else self._meter
            is_still = scale.is_still(change)
            if under_way in kinds.straight:
                self.is_stalled = is_still or bumped
            else:
                self.is_stalled = is_still and under_way in kinds.others and under_way not in stands
            if not is_still and not bumped and at_s >= self._barred_until_s:
                self.futile = []
            self._note(picture, under_way, at_s, None if bumped else scale)
        return self.futile[-1] if self.futile else None

    def _note(
        self,
        picture: NDArray[np.uint8],
        under_way: Action | None,
        at_s: float,
        scale: ChangeMeter | None,
    ) -> None:
        """Give a move up after its time, unless the picture crept on meanwhile as `scale` tells."""
        if under_way is None or not self.is_stalled:
            self._stuck_since = None
        elif self._stuck_since is None:
            self._stuck_since = at_s, picture
        elif at_s - self._stuck_since[0] >= self.patience_s - STEP_S:
            if scale is None or scale.is_still(difference(picture, self._stuck_since[1])):
                self.futile = [*(move for move in self.futile if move is not under_way), under_way]
                self._barred_until_s = at_s + AWAY_S
            self._stuck_since = None

    def lift(self) -> None:
        """Bar nothing: what had no effect is tried again."""
        self._stuck_since = None
        self.futile = []

    def reset(self) -> None:
        """Forget what belongs to one drive; the scale of change stays."""
        self._meter.reset()
        self.lift()
        self.is_stalled = False
