"""Detects a camera that sends no pictures, or repeats one picture. Pure; runs on Python 3.5."""

from typing import Optional

REOPEN_S = 0.5
"""Pause between two searches for a lost camera, in seconds."""
STILL_S = 0.35
"""A camera counts as broken after its period plus this time without a new picture, in seconds. A
fault is therefore detected within 500 ms plus the camera's period."""
LONGEST_PERIOD_S = 1.2
"""Upper bound for the period that a camera is assumed to have, in seconds."""
_BURST_S = 0.02
"""If two pictures arrive within this time, in seconds, the link has sent them together. The time
between such pictures says nothing about the camera's period."""


class Freshness:
    """Detects a camera that delivers no pictures, or the same picture again and again."""

    def __init__(self, now_s: float) -> None:
        self._new_s = now_s
        self._seen_s = now_s
        self._last = b""
        self._period_s = None  # type: Optional[float]

    def is_new(self, data: bytes, now_s: float) -> bool:
        """Record a picture. Return False if it is identical to the last picture. Because of noise,
        a working sensor never yields the same picture twice."""
        self._seen_s = now_s
        if data == self._last:
            return False
        if self._last and now_s - self._new_s > _BURST_S:
            self._learn_period(now_s - self._new_s)
        self._last, self._new_s = data, now_s
        return True

    def _learn_period(self, gap_s: float) -> None:
        """Update the estimate of the camera's period. The estimate shrinks immediately, but one
        lost picture increases it by at most a tenth."""
        if self._period_s is None:
            self._period_s = min(gap_s, LONGEST_PERIOD_S)
        self._period_s = min(gap_s, 1.1 * self._period_s, LONGEST_PERIOD_S)

    @property
    def patience_s(self) -> float:
        """Time without a new picture after which the camera counts as faulty, in seconds."""
        return STILL_S + (self._period_s or 0.0)

    def continue_from(self, before: "Freshness") -> None:
        """Call this after the camera was reopened; `before` is its earlier record. If the camera
        then repeats the last picture of this record, the picture does not count as new."""
        self._last = before._last

    def fault(self, now_s: float) -> Optional[str]:
        """Return the fault, such as "gives no pictures"; None while new pictures come."""
        if now_s - self._new_s <= self.patience_s:
            return None
        # A camera that repeats its picture at long intervals still sends pictures.
        if now_s - self._seen_s <= max(self.patience_s, STILL_S + LONGEST_PERIOD_S):
            return "repeats one picture" if self._seen_s > self._new_s else "gives no pictures"
        return "gives no pictures"
