"""Detects a stalled robot: straight motion is commanded, the image does not change.

A pilot seldom lets it come to that, so no example shows the view from there, and votes alone would
push on for ever. An image that does not change shows it, or a bumper where there is one. A turn is
not watched here: near a plain wall it changes the picture little. `progress_clock.py` watches it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot.types import Action

STRAIGHT = (Action.FORWARD, Action.BACKWARD)
STUCK_S = 0.5
"""After so long without effect a straight move is given up, if the pilot never meant to push,"""
AWAY_S = 1.5
"""and not taken up again for so long, nor before the robot moves."""
_STEP_S = 0.1
_STILL_SHARE = 0.25
_RISE, _FALL = 0.1, 0.001


class StillnessMeter:
    """Compares each picture with the one of a tenth of a second before.

    What counts as still depends on how much the picture usually changes: a scale that rises
    quickly (though not by a single flash of light) and falls slowly.

    Attributes:
        before: The picture that the next is compared with.
    """

    def __init__(self) -> None:
        self.before: NDArray[np.uint8] | None = None
        self._before_s = 0.0
        self._usual = 0.0

    def is_still(self, picture: NDArray[np.uint8], at_s: float) -> bool | None:
        """Return None if the last picture that was compared is too new, or there is none.

        Args:
            picture: The frame in grey, of any one shape.
            at_s: When the frame was taken.
        """
        if self.before is None or at_s < self._before_s:
            self.before, self._before_s = picture, at_s
            return None
        if at_s - self._before_s < 0.9 * _STEP_S:
            return None
        step = picture.astype(np.int16) - self.before.astype(np.int16)
        change = float(np.abs(step).mean())
        self.before, self._before_s = picture, at_s
        usual = self._usual or change
        rate = _RISE if change > usual else _FALL
        self._usual = usual + rate * (min(change, 2 * usual) - usual)
        return change < _STILL_SHARE * self._usual

    def reset(self) -> None:
        """Forget what belongs to one drive; the scale stays."""
        self.before = None

    def get_state(self) -> list[float]:
        """Return the time of `before` and the scale."""
        return [self._before_s, self._usual]

    def set_state(self, values: list[float], before: NDArray[np.uint8] | None) -> None:
        """Restore what `get_state` returned, with `before`."""
        self._before_s, self._usual = values
        self.before = None if before is None else before.copy()


class StallDetector:
    """Bars a straight move that has no effect.

    Attributes:
        patience_s: How long a straight move may be without effect: more for a pilot who pushes
            things on purpose (`pilot_pace.py`).
        is_stalled: True while a straight move under way has no effect.
    """

    def __init__(self) -> None:
        self.patience_s = STUCK_S
        self.is_stalled = False
        self._stillness = StillnessMeter()
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
        """Look at one more frame; return the move that has no effect now, if there is one.

        Args:
            picture: The frame in grey, of any one shape.
            under_way: The move that the robot makes by its own choice; None if it does not.
            at_s: When the frame was taken.
            bumped: True if a bumper is pressed.
        """
        is_still = self._stillness.is_still(picture, at_s)
        if is_still is not None:
            self._note(is_still or bumped, under_way, at_s)
        return self._barred

    def _note(self, is_stuck: bool, under_way: Action | None, at_s: float) -> None:
        self.is_stalled = is_stuck and under_way in STRAIGHT
        if not is_stuck and at_s >= self._barred_until_s:
            self._barred = None
        if not self.is_stalled:
            self._stuck_since_s = None
        elif self._stuck_since_s is None:
            self._stuck_since_s = at_s
        elif at_s - self._stuck_since_s >= self.patience_s - _STEP_S:
            self._barred, self._barred_until_s = under_way, at_s + AWAY_S
            self._stuck_since_s = None

    def reset(self) -> None:
        """Forget what belongs to one drive; the scale of change stays."""
        self._stillness.reset()
        self._stuck_since_s = self._barred = None
        self.is_stalled = False
