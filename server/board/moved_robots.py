"""Recognises a robot of the class that has come back under another address.

The board never gives up an address: it stays connected to each, or tries to connect, and sends each
STOP to all of them. A robot is recognised by its id. Several robots can have the same id, for
example because the SD card of one is a copy of the other's. The board must not take two robots for
one that has moved, because it would then not name a robot that a STOP did not reach. Therefore only
a link without a connection can count as moved. And if two processes with the same id were alive at
the same time, they are two robots, so no link with this id counts as moved any more.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from server.board.robot_link import RobotLink
from server.board.teacher_session import Status


@dataclass(slots=True)
class _Life:
    """When a robot's process was first and last heard, on the clock."""

    first_s: float
    last_s: float


class MovedRobots:
    """Finds the links whose robots are now at another address."""

    def __init__(self) -> None:
        self._lives: dict[str, dict[str, _Life]] = {}
        self._shared: set[str] = set()
        """The ids that several robots have."""

    def note(self, robot: RobotLink) -> None:
        """Note that a robot was connected or heard, or that the connection to it was lost."""
        if robot.id is None or robot.run_id is None:
            return
        lives = self._lives.setdefault(robot.id, {})
        own = lives.setdefault(robot.run_id, _Life(robot.heard_s, robot.heard_s))
        own.last_s = max(own.last_s, robot.heard_s)
        for other in lives.values():
            if other is not own and other.last_s > own.first_s and own.last_s > other.first_s:
                self._shared.add(robot.id)

    def successor(self, robots: Iterable[RobotLink], robot: RobotLink) -> RobotLink | None:
        """Return the link on which a robot is now; None if this is `robot` itself."""
        if robot.status is Status.THERE or robot.id is None or robot.id in self._shared:
            return None
        newest = max((one for one in robots if one.id == robot.id), key=_rank)
        return None if newest is robot else newest


def _rank(robot: RobotLink) -> tuple[bool, float]:
    return robot.status is Status.THERE, robot.joined_s
