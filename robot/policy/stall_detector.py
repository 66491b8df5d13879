"""Wheels that drive straight and gain no way: the robot pushes something.

A pilot seldom lets it come to that, so no lesson shows the view from there, and votes alone would
push on for ever. A picture that does not move tells it, and a bumper where there is one. A turn is
never given up: it is the way out, and near a plain wall it changes the picture little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot.types import Action

STRAIGHT = (Action.FORWARD, Action.BACKWARD)
STUCK_S = 0.5
"""After so long without any way gained, a move is given up,"""
AWAY_S = 1.5
"""and not taken up again for so long, nor before the robot moves."""
_STEP_S = 0.1
_STILL_SHARE = 0.25
_RISE, _FALL = 0.1, 0.001


class StallDetector:
    """Compares each picture with the one of a tenth of a second before.

    What counts as still follows from how much the picture usually changes: a scale that rises
    quickly (though not by a single flash of light) and falls slowly.
    """

    def __init__(self) -> None:
        self._before: NDArray[np.int16] | None = None
        self._before_s = 0.0
        self._usual = 0.0
        self._stuck_since_s: float | None = None
        self._barred: Action | None = None
        self._barred_until_s = 0.0

    def barred(
        self,
        picture: NDArray[np.uint8],
        under_way: Action | None,
        at_s: float,
        *,
        bumped: bool = False,
    ) -> Action | None:
        """Look at one more frame; return the move that leads nowhere now, if there is one.

        Args:
            picture: The frame in grey, of any one shape.
            under_way: The move that the robot makes by its own choice; None if it does not.
            at_s: When the frame was taken.
            bumped: True if a bumper is pressed.
        """
        is_still = self._is_still(picture.astype(np.int16), at_s)
        if is_still is not None:
            self._note(is_still or bumped, under_way, at_s)
        return self._barred

    def _note(self, is_stuck: bool, under_way: Action | None, at_s: float) -> None:
        if not is_stuck and at_s >= self._barred_until_s:
            self._barred = None
        if not is_stuck or under_way not in STRAIGHT:
            self._stuck_since_s = None
        elif self._stuck_since_s is None:
            self._stuck_since_s = at_s
        elif at_s - self._stuck_since_s >= STUCK_S - _STEP_S:
            self._barred, self._barred_until_s = under_way, at_s + AWAY_S
            self._stuck_since_s = None

    def _is_still(self, picture: NDArray[np.int16], at_s: float) -> bool | None:
        """Return None if the last picture that was compared is too new."""
        if self._before is None or at_s < self._before_s:
            self._before, self._before_s = picture, at_s
            return None
        if at_s - self._before_s < 0.9 * _STEP_S:
            return None
        change = float(np.abs(picture - self._before).mean())
        self._before, self._before_s = picture, at_s
        usual = self._usual or change
        rate = _RISE if change > usual else _FALL
        self._usual = usual + rate * (min(change, 2 * usual) - usual)
        return change < _STILL_SHARE * self._usual

    def reset(self) -> None:
        """Begin another drive; the scale stays."""
        self._before = self._stuck_since_s = self._barred = None
