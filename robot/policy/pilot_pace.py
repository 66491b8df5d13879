"""How long the pilot turns and pushes: it sets how long the robot may.

Learned only from the labelled frames and their teaching time, so that learning the same examples
again after an undo gives the same values.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.policy.progress_clock import ProgressClock
from robot.policy.stall_detector import STRAIGHT, STUCK_S, StillnessMeter
from robot.types import TURNS, Action

SHORTEST_DEBT_S, LONGEST_DEBT_S = 1.5, 8.0
"""Bounds of the debt (`ProgressClock`) that a pilot is taken to allow himself, in seconds.

The longest is less than half a turn about one wheel takes: who turns to and fro for longer shows
no way out."""
_MEANT = 3
"""A pilot who pushed so often for so long meant it: once may be a slip."""
_PATIENCE, _LONGEST_PATIENCE_S = 1.5, 5.0
_TURNS, _FEWEST_TURNS = 32, 5
_ALIKE, _TIMED = 0.1, 0.75
"""Turns are timed if three quarters of the last ones differ by at most a tenth from the median."""
_SHORTEST_TURN_S = 0.3
"""A shorter turn is a slip of the finger."""
PAUSE_S = 0.45
"""A longer gap of teaching time between two examples ends a manoeuvre."""


class PilotPace:
    """How long a pilot's manoeuvres take.

    Attributes:
        longest_debt_s: Largest debt (`ProgressClock`) of the pilot's own driving, within bounds.
        timed_turn_s: How long the pilot's turns take if they always take the same time; else None.
            A person turns until the way is free, which takes now one second and now four. Turns
            of one length end by the clock, and not by anything that can be seen.
    """

    def __init__(self) -> None:
        self.longest_debt_s = SHORTEST_DEBT_S
        self._pushes_s = [0.0] * _MEANT
        self._push_s = 0.0
        self.timed_turn_s: float | None = None
        self._turns_s: list[float] = []
        self._turn_s = 0.0
        self._turning: Action | None = None
        self._last_s = 0.0
        self._clock = ProgressClock()
        self._stillness = StillnessMeter()

    @property
    def patience_s(self) -> float:
        """How long the robot may push: 1.5 times as long as the pilot did at least three times."""
        return min(max(STUCK_S, _PATIENCE * min(self._pushes_s)), _LONGEST_PATIENCE_S)

    def learn(self, label: Action, picture: NDArray[np.uint8], at_s: float) -> None:
        """Update from one labelled frame.

        Args:
            label: What the pilot did.
            picture: The frame in grey, of any one shape.
            at_s: Its teaching time.
        """
        step_s, self._last_s = at_s - self._last_s, at_s
        if not 0.0 <= step_s <= PAUSE_S:
            step_s = 0.0
            self._end_push()
            self._end_turn()
            self._clock.reset()
            self._stillness.reset()
        is_still = self._stillness.is_still(picture, at_s)
        if label not in STRAIGHT or is_still is False:
            self._end_push()
        elif is_still or self._push_s > 0.0:  # None: too soon to tell
            self._push_s += step_s
        if label is not self._turning:
            self._end_turn()
            self._turning = label if label in TURNS else None
        elif label in TURNS:
            self._turn_s += step_s
        self._clock.note(label, at_s, is_stalled=self._push_s > 0.0)
        debt_s = min(self._clock.debt_s, LONGEST_DEBT_S)
        self.longest_debt_s = max(self.longest_debt_s, debt_s)

    def _end_push(self) -> None:
        self._pushes_s = sorted([*self._pushes_s, self._push_s])[-_MEANT:]
        self._push_s = 0.0

    def _end_turn(self) -> None:
        if self._turn_s >= _SHORTEST_TURN_S:
            self._turns_s = [*self._turns_s[1 - _TURNS :], self._turn_s]
            self.timed_turn_s = _timed(self._turns_s)
        self._turn_s, self._turning = 0.0, None

    def get_state(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return all of it as plain values and arrays."""
        values = {
            "longest_debt_s": self.longest_debt_s,
            "pushes_s": list(self._pushes_s),
            "push_s": self._push_s,
            "turns_s": list(self._turns_s),
            "turn_s": self._turn_s,
            "turning": self._turning,
            "last_s": self._last_s,
            "clock": self._clock.get_state(),
            "stillness": self._stillness.get_state(),
        }
        before = self._stillness.before
        return values, {} if before is None else {"pace_picture": before.copy()}

    def set_state(self, values: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Restore what `get_state` returned."""
        self.longest_debt_s = float(values["longest_debt_s"])
        self._pushes_s = [float(push_s) for push_s in values["pushes_s"]]
        self._push_s, self._last_s = float(values["push_s"]), float(values["last_s"])
        self._turns_s = [float(turn_s) for turn_s in values.get("turns_s", [])]
        self.timed_turn_s = _timed(self._turns_s)
        self._turn_s = float(values.get("turn_s", 0.0))
        turning = values.get("turning")
        self._turning = None if turning is None else Action(turning)
        self._clock.set_state(values["clock"])
        self._stillness.set_state(values["stillness"], arrays.get("pace_picture"))


def _timed(turns_s: list[float]) -> float | None:
    """Return the median if most of the turns are about as long, else None."""
    if len(turns_s) < _FEWEST_TURNS:
        return None
    usual_s = sorted(turns_s)[len(turns_s) // 2]
    like_it = sum(abs(turn_s - usual_s) <= _ALIKE * usual_s for turn_s in turns_s)
    return usual_s if like_it >= _TIMED * len(turns_s) else None
