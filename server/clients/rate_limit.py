"""Rate limits for clients. Pure: the time is an argument."""

from __future__ import annotations


class RateLimit:
    """A token bucket: an average rate of messages a second, and a largest burst."""

    def __init__(self, *, per_second: float, burst: float) -> None:
        self._per_second = per_second
        self._burst = burst
        self._tokens = burst
        self._last_s: float | None = None

    def allows(self, now_s: float) -> bool:
        """Take one token; return False if there is no token."""
        if self._last_s is not None:
            earned = max(now_s - self._last_s, 0.0) * self._per_second
            self._tokens = min(self._burst, self._tokens + earned)
        self._last_s = now_s
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
