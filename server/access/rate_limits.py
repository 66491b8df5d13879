"""Rate limits, one for each name. Pure: the time is an argument."""

from __future__ import annotations

from functools import lru_cache

from server.clients.rate_limit import RateLimit

_NAMES = 1024
"""Maximum number of names with a bucket."""


class RateLimits:
    """A token bucket for each of many names; the least recently used bucket is forgotten."""

    def __init__(self) -> None:
        self._of = lru_cache(_NAMES)(lambda _, rate, burst: RateLimit(per_second=rate, burst=burst))

    def allows(self, name: str, now_s: float, *, per_second: float, burst: float) -> bool:
        """Take one of this name's tokens; return False if no token is left."""
        return self._of(name, per_second, burst).allows(now_s)
