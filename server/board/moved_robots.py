"""Recognises a robot of the class that has come back under another address.

The board never gives up an address: it stays connected, or keeps trying to connect, and sends every
STOP to a robot's old addresses, too. A robot is recognised by its id. Two robots can have the same
id, for example if the SD card of one is a copy of the other's. If the board took them for one robot
that has moved, it would not report that a STOP did not reach one of them. Therefore only a link
without a connection can count as moved. If two processes with the same id were alive at the same
time, there are two robots; after that, no link with this id counts as moved.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from server.board.robot_link import RobotLink
from server.board.teacher_session import Status


@dataclass(slots=True)
class _Life:
    """When a robot's process was first and last heard from, on the clock."""

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
        """Return the link to a robot's new address; None if the robot has not moved."""
        if robot.status is Status.THERE or robot.id is None or robot.id in self._shared:
            return None
        newest = max((one for one in robots if one.id == robot.id), key=_rank)
        return None if newest is robot else newest


def _rank(robot: RobotLink) -> tuple[bool, float]:
    return robot.status is Status.THERE, robot.joined_s
