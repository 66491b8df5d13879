"""Rate limits for clients and addresses. Pure: the time is an argument."""

from __future__ import annotations

from functools import lru_cache

_NAMES = 1024
"""Number of names whose rate is remembered."""


class RateLimit:
    """A token bucket: an average rate of messages a second, and a largest burst."""

    def __init__(self, *, per_second: float, burst: float) -> None:
        self._per_second = per_second
        self._burst = burst
        self._tokens = burst
        self._last_s: float | None = None

    def allows(self, now_s: float) -> bool:
        """Take one token; False if there is none."""
        if self._last_s is not None:
            earned = max(now_s - self._last_s, 0.0) * self._per_second
            self._tokens = min(self._burst, self._tokens + earned)
        self._last_s = now_s
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True


class RateLimits:
    """A token bucket for each of many names; the least recently used one is forgotten."""

    def __init__(self) -> None:
        self._of = lru_cache(_NAMES)(lambda _, rate, burst: RateLimit(per_second=rate, burst=burst))

    def allows(self, name: str, now_s: float, *, per_second: float, burst: float) -> bool:
        """Take one of this name's tokens; False if there is none."""
        return self._of(name, per_second, burst).allows(now_s)
