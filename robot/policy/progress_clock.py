"""Counts time without progress as a debt, which driving straight pays back.

The same clock runs for the pilot and for the robot, so that the pilot's own longest manoeuvre sets
how long the robot may turn before it has to try something else.
"""

from __future__ import annotations

from robot.policy.move_kinds import MoveKinds
from robot.types import Action

PAYS_BACK = 4.0
"""A second of driving straight pays for so many seconds of turning."""
EFFECT_S = 0.2
"""A straight move pays from here on: sooner nobody can tell if it has an effect."""
_LONGEST_STEP_S = 0.25


def passed_s(last_s: float | None, at_s: float) -> float:
    """Return the time since the last frame, a quarter of a second at most; 0 for a first frame."""
    return 0.0 if last_s is None else min(max(at_s - last_s, 0.0), _LONGEST_STEP_S)


class ProgressClock:
    """Counts a debt in seconds.

    Turning either way, and pushing without effect, add to it; driving straight with effect takes
    four times as much off; it is never below 0.

    Args:
        kinds: Which moves are turns.
    """

    def __init__(self, kinds: MoveKinds) -> None:
        self._kinds = kinds
        self.debt_s = 0.0
        self.straight_s = 0.0
        """For how long the robot has been driving straight with effect."""
        self._last_s: float | None = None

    def note(self, action: Action | None, at_s: float, *, is_stalled: bool = False) -> None:
        """Update the debt by the move that has been under way since the last call.

        Args:
            action: The move; None or STOP change nothing.
            at_s: Now, in seconds.
            is_stalled: True if it has no effect.
        """
        step_s = passed_s(self._last_s, at_s)
        self._last_s = at_s
        if action is None or action is Action.STOP:
            return
        if action in self._kinds.turns or is_stalled:
            self.debt_s += step_s
            self.straight_s = 0.0
        else:
            self.straight_s += step_s
            if self.straight_s > EFFECT_S:
                self.debt_s = max(0.0, self.debt_s - PAYS_BACK * step_s)

    def reset(self) -> None:
        """Forget the debt: a new drive begins."""
        self.debt_s = self.straight_s = 0.0
        self._last_s = None

    @property
    def values(self) -> tuple[float, float, float | None]:
        """Debt, time straight, and the time of the last call."""
        return self.debt_s, self.straight_s, self._last_s

    @values.setter
    def values(self, values: tuple[float, float, float | None]) -> None:
        self.debt_s, self.straight_s, self._last_s = values
