"""The newest STOP, numbered so that no older message undoes it. Pure: the time is an argument."""

from __future__ import annotations

import math
import secrets

from server.gateway.roles import Role
from server.protocol import ErrorCode, ProtocolError

_RECENT_S = 2.0
"""Time after a STOP in which a request to start must prove that it is newer, in seconds. Older
requests do not arrive later than that, because a page repeats a request for only one second."""


class EmergencyStop:
    """The newest STOP.

    Attributes:
        number: The number of the newest STOP; each STOP adds one, even while another is latched.
        held_by: The role that stopped the robot, if only that role may release it.
    """

    def __init__(self) -> None:
        self.number = 1 + secrets.randbelow(2**31)  # an old message cannot contain this number
        self.held_by: Role | None = None
        self._pressed_s = -math.inf

    def press(self, role: Role, now_s: float) -> None:
        """Count a new STOP. A role with `holds_stop` reserves the release of STOP for itself."""
        if role.holds_stop:
            self.held_by = role
        self.number += 1
        self._pressed_s = now_s

    def check_release(self, number: int, role: Role) -> None:
        """Raise ProtocolError if there is a newer STOP, or if this role may not release STOP."""
        if number != self.number:
            sentence = "STOP was pressed again; check the robot, then release STOP again"
            raise ProtocolError(ErrorCode.NEWER_STOP, sentence)
        if self.held_by is not None and role is not self.held_by:
            sentence = f"only the {self.held_by.value} may release STOP"
            raise ProtocolError(ErrorCode.STOP_HELD, sentence)

    def check_start(self, seq: int, proven_s: float, now_s: float) -> None:
        """Raise ProtocolError if a start that was sent after `proven_s` may be older than STOP."""
        if proven_s < self._pressed_s >= now_s - _RECENT_S:
            sentence = "STOP was pressed later; check the robot, then choose the mode again"
            raise ProtocolError(ErrorCode.NEWER_STOP, sentence, seq)
