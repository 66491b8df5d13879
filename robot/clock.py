"""Time as an argument: the real clock, and one that a simulation or a test moves by hand."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Monotonic seconds since an arbitrary start."""

    def now_s(self) -> float:
        """Return the present time in seconds; it never goes backwards."""
        ...


class RealClock:
    """The machine's monotonic clock; jumps of the wall clock do not touch it."""

    def now_s(self) -> float:
        """Return `time.monotonic()`."""
        return time.monotonic()


class ManualClock:
    """A clock that stands until it is moved: simulations run on it faster than real time."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s

    def now_s(self) -> float:
        """Return the time that the clock was last moved to."""
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Move the clock on by `seconds`.

        Raises:
            ValueError: If `seconds` is negative.
        """
        if seconds < 0:
            raise ValueError(f"a clock cannot go back by {-seconds} s")
        self._now_s += seconds
