"""Is a camera alive? Detects one that is silent, or repeats one picture. Python 3.5, pure."""

from typing import Optional

REOPEN_S = 0.5
"""How often a lost camera is looked for."""
STILL_S = 0.35
"""A camera that shows nothing new for so long is broken: noticed within 500 ms."""


class Freshness:
    """Tells a living camera from one that is silent or shows one picture for ever. Pure."""

    def __init__(self, now_s: float) -> None:
        self._new_s = now_s
        self._seen_s = now_s
        self._last = b""

    def is_new(self, data: bytes, now_s: float) -> bool:
        """Take note of a picture. False for an exact repeat: a living sensor has noise."""
        self._seen_s = now_s
        if data == self._last:
            return False
        self._last, self._new_s = data, now_s
        return True

    def fault(self, now_s: float) -> Optional[str]:
        """What is wrong, or None."""
        if now_s - self._new_s <= STILL_S:
            return None
        if now_s - self._seen_s <= STILL_S:
            return "repeats one picture"
        return "gives no pictures"
