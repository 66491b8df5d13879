"""One fault, one sentence: what a person reads does not flicker while its cause lasts. Pure."""

from __future__ import annotations

import math

STEADY_S = 3.0
"""How long a sentence stands before another may take its place, and how long a fault must be away
from a standing robot before it counts as gone, in seconds: long enough to read it."""


class SteadyFault:
    """Chooses which sentence to show of those that come and go.

    A new fault is shown at once. A camera that repeats a picture once a second, or a sentence that
    counts its seconds, keeps the sentence that it has.
    """

    def __init__(self) -> None:
        self.shown: str | None = None
        self._changed_s = self._seen_s = -math.inf

    def show(self, fault: str | None, now_s: float, *, may_move: bool) -> str | None:
        """Take in what is wrong now, and return what to show.

        A robot that `may_move` was started since: nothing that is over is shown any more.
        """
        if fault is not None:
            self._seen_s = now_s
            is_due = self.shown is None or now_s - self._changed_s >= STEADY_S
            if is_due and fault != self.shown:
                self.shown, self._changed_s = fault, now_s
        elif may_move or now_s - self._seen_s >= STEADY_S:
            self.shown = None
        return self.shown
