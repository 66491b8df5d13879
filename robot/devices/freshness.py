"""Is a camera alive? Detects one that is silent, or repeats one picture. Python 3.5, pure."""

from typing import Optional

REOPEN_S = 0.5
"""How often a lost camera is looked for."""
STILL_S = 0.35
"""A camera that shows nothing new for so long, and its own period, is broken: noticed within
500 ms and the period."""
LONGEST_PERIOD_S = 1.2
"""A camera slower than this does not make us more patient."""
_BURST_S = 0.02
"""Pictures that come closer together were sent together: that is not the camera's period."""


class Freshness:
    """Detects a camera that delivers nothing, or the same picture again and again."""

    def __init__(self, now_s: float) -> None:
        self._new_s = now_s
        self._seen_s = now_s
        self._last = b""
        self._period_s = None  # type: Optional[float]

    def is_new(self, data: bytes, now_s: float) -> bool:
        """Take note of a picture. False for an exact repeat: a living sensor has noise."""
        self._seen_s = now_s
        if data == self._last:
            return False
        if self._last and now_s - self._new_s > _BURST_S:
            self._learn_period(now_s - self._new_s)
        self._last, self._new_s = data, now_s
        return True

    def _learn_period(self, gap_s: float) -> None:
        """Quick to shrink, slow to grow: one lost picture must not add patience."""
        if self._period_s is None:
            self._period_s = min(gap_s, LONGEST_PERIOD_S)
        self._period_s = min(gap_s, 1.1 * self._period_s, LONGEST_PERIOD_S)

    @property
    def patience_s(self) -> float:
        """How long the camera may show nothing new."""
        return STILL_S + (self._period_s or 0.0)

    def continue_from(self, before: "Freshness") -> None:
        """Keep the last picture of a camera that was opened again: it may still repeat it."""
        self._last = before._last

    def fault(self, now_s: float) -> Optional[str]:
        """What is wrong, or None."""
        if now_s - self._new_s <= self.patience_s:
            return None
        # A camera that repeats its picture more seldom than new ones came is still there.
        if now_s - self._seen_s <= max(self.patience_s, STILL_S + LONGEST_PERIOD_S):
            return "repeats one picture" if self._seen_s > self._new_s else "gives no pictures"
        return "gives no pictures"
