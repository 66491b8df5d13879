"""One fault, one sentence: the text on the page does not flicker while its cause lasts. Pure."""

from __future__ import annotations

import math

STEADY_S = 3.0
"""Least time that a sentence stays, in seconds: long enough to read it. A fault of a standing robot
must be away for the same time before it counts as gone."""


class SteadyFault:
    """Chooses the sentence to show while faults come and go.

    A new fault is shown at once. A camera that repeats a picture once a second, or a sentence that
    counts its seconds, keeps the sentence that it has.
    """

    def __init__(self) -> None:
        self.shown: str | None = None
        self._changed_s = self._seen_s = -math.inf

    def show(self, fault: str | None, now_s: float, *, may_move: bool) -> str | None:
        """Take the present fault, and return the sentence to show.

        A robot that `may_move` was started since, so old faults are not shown any more.
        """
        if fault is not None:
            self._seen_s = now_s
            is_due = self.shown is None or now_s - self._changed_s >= STEADY_S
            if is_due and fault != self.shown:
                self.shown, self._changed_s = fault, now_s
        elif may_move or now_s - self._seen_s >= STEADY_S:
            self.shown = None
        return self.shown
