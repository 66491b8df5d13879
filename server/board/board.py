"""All robots of a class, the board's open pages, and STOP for all robots at the same time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from robot.clock import Clock
from robot.errors import NotFoundError
from server.board.class_key import ClassKey
from server.board.moved_robots import MovedRobots
from server.board.robot_link import RobotLink
from server.board.stopping import Stopping
from server.board.teacher_session import TeacherSession
from server.board.transport import NetworkTransport, RobotAddress
from server.board.unverified_robots import UnverifiedRobots
from server.routes.bodies import do

PICTURE_EVERY_S = 1.0
OWN_ADDRESS_EVERY_S = 2.0
"""Interval at which the board looks up this computer's address, in seconds."""


class BoardViewer:
    """One open page of the board, with the news and pictures that it has not received yet.

    Attributes:
        due: Set when there is something to send; wakes the task that sends to the page.
        may_send: Set while further pictures may be sent, because the page has drawn the last ones.
    """

    def __init__(self) -> None:
        self.watched: frozenset[int] = frozenset()
        self.changed: set[int] = set()
        self.pictures: dict[int, bytes] = {}
        self.strangers_changed = False
        self.due, self.may_send = asyncio.Event(), asyncio.Event()
        self.may_send.set()


class Board:
    """The robots of one class. Everything runs on one event loop.

    Attributes:
        robots: The links to the robots of the class by number: to those that the teacher listed,
            and to those that have proved that they know the key. Links are never removed. If a
            robot has moved, the link to its old address has the higher number.
        strangers: The other robots that the network announces.
        code: The token on the printed cards, for phones that cannot scan.
    """

    def __init__(
        self,
        key: ClassKey,
        transport: NetworkTransport,
        clock: Clock,
        picture_every_s: float = PICTURE_EVERY_S,
    ) -> None:
        self._clock, self.code = clock, key.code
        self._meet = partial(TeacherSession, key=key, transport=transport)
        self._picture_every_s = picture_every_s
        self.robots: dict[int, RobotLink] = {}
        self._moved = MovedRobots()
        self._noted: dict[RobotAddress, object] = {}
        self._own_host: str | None = None
        self.strangers = UnverifiedRobots(self._meet, clock, self.add, self._note_strangers)
        self._tasks: list[asyncio.Task[None]] = []
        self._onlookers: list[BoardViewer] = []
        self.at_leisure = asyncio.Event()
        """Cleared when STOP is pressed, until the stop is confirmed or reported as failed.

        While it is cleared, the board sends no pictures or news, so that the stop is not delayed.
        """
        self.at_leisure.set()

    def add(self, address: RobotAddress) -> RobotLink | None:
        """Add a robot to the class and connect to it; return None if it was already added."""
        if self.has(address):
            return None
        robot = RobotLink(
            len(self.robots) + 1,
            self._meet(address),
            self._clock,
            self._note_news,
            self._note_picture,
            self.at_leisure,
        )
        robot.own_host = self._own_host
        self.robots[robot.number] = robot
        self._tasks.append(asyncio.create_task(robot.run()))
        self._note_news(robot)
        return robot

    def follow_own_address(self, look: Callable[[], str | None]) -> None:
        """From now on, give phones the address that `look` returns, for robots on this computer.

        `look` runs on a thread, every `OWN_ADDRESS_EVERY_S`.
        """
        self._tasks.append(asyncio.create_task(self._follow_own_address(look)))

    async def _follow_own_address(self, look: Callable[[], str | None]) -> None:
        while True:
            found = await do(look)
            if found != self._own_host:
                self._own_host = found
                for robot in self.robots.values():
                    robot.own_host = found
                    self._note_news(robot)
            await self._clock.pause(OWN_ADDRESS_EVERY_S)

    def announce(self, address: RobotAddress) -> None:
        """Note an announced robot; it is added once it has proved that it knows the class key."""
        if not self.has(address):
            self.strangers.announce(address)

    def has(self, address: RobotAddress) -> bool:
        return any(robot.address == address for robot in self.robots.values())

    async def close(self) -> None:
        await self.strangers.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def robot(self, number: object) -> RobotLink:
        """Return a robot by its number; raises NotFoundError if there is none."""
        if not isinstance(number, int) or number not in self.robots:
            raise NotFoundError(f"there is no robot {number} on this board")
        return self.robots[number]

    def shown(self) -> list[RobotLink]:
        """Return the links that have a card: all except those to old addresses of moved robots."""
        return [robot for robot in self.robots.values() if self._successor(robot) is None]

    def describe(self) -> list[dict[str, Any]]:
        return [robot.describe() for robot in self.shown()]

    def stop(self, number: object = None) -> None:
        """Stop one robot, or all of them, immediately; raises NotFoundError if there is none.

        A robot is stopped at its old addresses, too, in case another robot answers there.
        """
        robots = list(self.robots.values())
        if number is not None:
            chosen = self.robot(number)
            robots = [one for one in robots if one is chosen or self._successor(one) is chosen]
        if robots:
            self.at_leisure.clear()
        now_s = self._clock.now_s()
        for robot in robots:
            robot.stop.press(now_s)

    def release(self, stops: Mapping[int, str]) -> None:
        """Release stopped robots, except those that were stopped again in the meantime.

        Args:
            stops: The `stop_id` that the teacher has seen, by the robot's number.

        Raises:
            NotFoundError: If there is no robot with one of these numbers.
        """
        for robot, stop in [(self.robot(number), stop) for number, stop in stops.items()]:
            robot.stop.release(stop)

    # Pages -------------------------------------------------------------------------------------

    def join(self, page: BoardViewer) -> None:
        """Add a page, and send it the state of all robots."""
        self._onlookers.append(page)
        page.changed.update(self.robots)
        page.strangers_changed = True
        page.due.set()

    def leave(self, page: BoardViewer) -> None:
        self._onlookers.remove(page)
        self._choose_pictures()

    def watch(self, page: BoardViewer, numbers: Iterable[int]) -> None:
        """Set the robots whose pictures a page gets."""
        page.watched = frozenset(numbers)
        for number in set(page.pictures) - page.watched:
            del page.pictures[number]
        self._choose_pictures()

    def _choose_pictures(self) -> None:
        watched = frozenset[int]().union(*(page.watched for page in self._onlookers))
        for robot in self.robots.values():
            robot.show(self._picture_every_s if robot.number in watched else None)

    def _successor(self, robot: RobotLink) -> RobotLink | None:
        return self._moved.successor(self.robots.values(), robot)

    def _note_news(self, robot: RobotLink) -> None:
        self._moved.note(robot)
        if (link := (robot.id, robot.status, robot.joined_s)) != self._noted.get(robot.address):
            self._noted[robot.address] = link
            self._recognise()
        if not any(map(self._delays_news, self.robots.values())):
            self.at_leisure.set()
        for page in self._onlookers:
            page.changed.add(robot.number)
            page.due.set()

    def _delays_news(self, robot: RobotLink) -> bool:
        return robot.stop.stage is Stopping.ASKED and self._successor(robot) is None

    def _recognise(self) -> None:
        """If a robot has moved, give its new link the card and the stop of its old link."""
        for old in list(self.robots.values()):
            new = self._successor(old)
            if new is None:
                continue
            if old.stop.stage is not None and old.stop.pressed_s > new.stop.pressed_s:
                new.stop.press(old.stop.pressed_s)
            if old.number < new.number:
                old.number, new.number = new.number, old.number
                self.robots[old.number], self.robots[new.number] = old, new
                self._choose_pictures()
            for page in self._onlookers:
                page.changed |= {old.number, new.number}
                page.due.set()

    def _note_strangers(self) -> None:
        for page in self._onlookers:
            page.strangers_changed = True
            page.due.set()

    def _note_picture(self, robot: RobotLink, message: bytes) -> None:
        for page in self._onlookers:
            if robot.number in page.watched:
                page.pictures[robot.number] = message
                page.due.set()
