"""Shows one sentence for one fault: it does not flicker while the fault's cause lasts. Pure."""

from __future__ import annotations

import math

STEADY_S = 3.0
"""Least time for which a sentence stays, in seconds: long enough to read it. While the robot stands
still, a fault counts as gone if it does not return within this time."""


class SteadyFault:
    """Chooses the sentence to show while faults come and go.

    A new fault is shown immediately. The fault's sentence then stays, even if the fault comes and
    goes once a second, or if its text changes because it counts seconds.
    """

    def __init__(self) -> None:
        self.shown: str | None = None
        self._changed_s = self._seen_s = -math.inf

    def show(self, fault: str | None, now_s: float, *, may_move: bool) -> str | None:
        """Record the current fault, and return the sentence to show.

        A robot that `may_move` was started after the old faults, so they are no longer shown.
        """
        if fault is not None:
            self._seen_s = now_s
            is_due = self.shown is None or now_s - self._changed_s >= STEADY_S
            if is_due and fault != self.shown:
                self.shown, self._changed_s = fault, now_s
        elif may_move or now_s - self._seen_s >= STEADY_S:
            self.shown = None
        return self.shown
