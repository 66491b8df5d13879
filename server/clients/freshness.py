"""Proves that a message is fresh: it cannot be older than the nonce that it contains. Pure."""

from __future__ import annotations

import math
import secrets
from collections import OrderedDict
from collections.abc import Callable

from server.protocol import ErrorCode, ProtocolError

NEVER_S = -math.inf
"""The issue time of an unknown nonce, with which any message counts as too old."""
_KEPT_S = 2.0
"""How long a nonce is remembered, in seconds; a command with this nonce expires much sooner."""


class NonceLedger:
    """Issues nonces and remembers for a while when each nonce was issued.

    Every state and every frame has a nonce, and each command returns the newest one. The command
    cannot have been sent before that nonce was issued, however long it was delayed by a stalled
    link or a queue. The check trusts only the robot's own clock, and nobody can guess a nonce.

    Args:
        limit_s: Age above which a command is refused, in seconds.
        below: Returns a random whole number from 0 to its argument minus one.
    """

    def __init__(self, limit_s: float, below: Callable[[int], int] = secrets.randbelow) -> None:
        self._limit_s, self._below = limit_s, below
        self._issued_s: OrderedDict[int, float] = OrderedDict()

    def issue(self, now_s: float) -> int:
        """Return a new nonce: a random whole number from 1 that fits into 32 bits."""
        nonce = 1 + self._below(2**32 - 1)
        self._issued_s[nonce] = now_s
        self._issued_s.move_to_end(nonce)
        while now_s - next(iter(self._issued_s.values())) > _KEPT_S:
            self._issued_s.popitem(last=False)
        return nonce

    def issued_s(self, nonce: int | None) -> float:
        """Return when a nonce was issued; `NEVER_S` if the nonce is unknown or forgotten."""
        return NEVER_S if nonce is None else self._issued_s.get(nonce, NEVER_S)

    def why_refused(self, frame: int | None, seq: int) -> ProtocolError:
        """Return the error for a command that is too old, or that names no frame."""
        if frame is None:
            why = "'frame' must name the frame on the screen: nobody drives without a picture"
            return ProtocolError(ErrorCode.NO_PICTURE, why, seq)
        limit_ms = 1000 * self._limit_s
        why = f"'nonce' was not issued within the last {limit_ms:.0f} ms: message too old"
        return ProtocolError(ErrorCode.STALE, why, seq)
