"""The emergency stop: anyone latches it, and the teacher's is released by the teacher alone."""

from __future__ import annotations

import logging

from robot.control.loop import ControlLoop
from server.protocol import ErrorCode, ProtocolError
from server.security.access import Role

log = logging.getLogger(__name__)


class EmergencyStop:
    """The stop of one robot.

    Args:
        loop: The robot's control loop, where the stop is latched.

    Attributes:
        by_teacher: The board of the class has stopped the robot, and has not released it yet.
    """

    def __init__(self, loop: ControlLoop) -> None:
        self._loop = loop
        self.by_teacher = False

    def latch(self, source: str, role: Role) -> None:
        """Stop the robot, whoever asks."""
        self.by_teacher |= role is Role.TEACHER
        self._loop.latch_emergency()
        log.warning("emergency client=%s", source)

    def release(self, source: str, role: Role, *, has_wheel: bool) -> None:
        """Allow modes to be chosen again; the robot stays stopped until one is.

        Raises:
            ProtocolError: For who has not the wheel, and for pupils while the teacher's stop holds.
        """
        if role is Role.TEACHER:
            self.by_teacher = False
        elif self.by_teacher:
            raise ProtocolError(ErrorCode.TEACHER_STOP, "only the board of the class releases this")
        elif not has_wheel:
            raise ProtocolError(ErrorCode.NOT_PILOT, "another client has the wheel")
        self._loop.release_emergency()
        log.info("release client=%s", source)
