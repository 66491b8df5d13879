"""Robots that were announced and have not proved that they are of the class.

Each robot is asked for its proof. Robots that fail are shown separately, and forgotten when they
are no longer announced. The computers that announce robots take turns, so that a
computer that announces a thousand robots does not delay the others.
"""

from __future__ import annotations

import asyncio
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from robot.clock import Clock
from server.board.teacher_session import Status, TeacherSession, WrongClassError
from server.board.transport import RobotAddress, UnreachableError, within

AT_ONCE = 32
"""Maximum number of unverified robots that are asked for their proof at the same time. The
transport has twice as many threads, so half of them stay free for the robots of the class."""
FORGOTTEN_S = 180.0
"""Time without an announcement after which a robot is forgotten, in seconds. The network is queried
each minute."""
_MOST, _SHOWN = 4096, 30
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 2.0, 300.0
_RETRIED_S = 16.0
"""Longest pause, in seconds, after which a robot that did not answer is asked again although it was
not announced again. A robot is announced some seconds before its server answers."""


@dataclass(slots=True)
class UnverifiedRobot:
    """One unverified robot, with the time of its last announcement and the result of its check."""

    heard_s: float
    status: Status = Status.CONNECTING
    detail: str = ""
    pause_s: float = _FIRST_PAUSE_S
    not_before_s: float = -math.inf


class UnverifiedRobots:
    """Robots that were found on the network, but have not proved that they know the class key.
    `welcome` is called with the address of each robot that proves it."""

    def __init__(
        self,
        meet: Callable[[RobotAddress], TeacherSession],
        clock: Clock,
        welcome: Callable[[RobotAddress], object],
        on_change: Callable[[], None],
    ) -> None:
        self._meet, self._clock = meet, clock
        self._welcome, self._on_change = welcome, on_change
        self._known: dict[RobotAddress, UnverifiedRobot] = {}
        self._due: dict[RobotAddress, None] = {}
        self._asked: Counter[str] = Counter()
        self._asking: set[asyncio.Task[None]] = set()
        self._waiting: set[asyncio.Task[None]] = set()

    def announce(self, address: RobotAddress) -> None:
        """Note an announcement, and ask the robot for its proof unless it was asked recently."""
        now_s = self._clock.now_s()
        stranger = self._known.pop(address, None) or UnverifiedRobot(now_s)
        self._known[address] = stranger
        stranger.heard_s = now_s
        # begin with the robot that was announced longest ago
        for other, one in list(self._known.items()):
            if now_s - one.heard_s <= FORGOTTEN_S and len(self._known) <= _MOST:
                break
            del self._known[other]
            self._due.pop(other, None)
        if now_s >= stranger.not_before_s:
            self._due[address] = None
            self._ask_next()

    def describe(self) -> dict[str, Any]:
        """Return the number of unverified robots and the details of some, for the page."""
        since_s = self._clock.now_s() - FORGOTTEN_S
        there = {at: one for at, one in self._known.items() if one.heard_s >= since_s}
        rows = [
            {"address": str(address), "status": one.status.value, "detail": one.detail}
            for address, one in list(there.items())[-_SHOWN:]
        ]
        return {"count": len(there), "some": rows}

    async def close(self) -> None:
        self._due.clear()
        tasks = self._asking | self._waiting
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _ask_next(self) -> None:
        while self._due and len(self._asking) < AT_ONCE:
            address = min(self._due, key=lambda one: self._asked[one.host])
            del self._due[address]
            self._asked[address.host] += 1
            task = asyncio.create_task(self._ask(address, self._known[address]))
            self._asking.add(task)
            task.add_done_callback(self._note_asked)

    def _note_asked(self, task: asyncio.Task[None]) -> None:
        self._asking.discard(task)
        self._on_change()
        self._ask_next()

    async def _ask(self, address: RobotAddress, stranger: UnverifiedRobot) -> None:
        stranger.not_before_s = math.inf
        try:
            async with within():
                await self._meet(address).join()
        except WrongClassError as error:
            stranger.status, stranger.detail = error.status, str(error)
        except (UnreachableError, ValueError) as error:
            stranger.status, stranger.detail = Status.AWAY, str(error)
            if stranger.pause_s <= _RETRIED_S:
                again = asyncio.create_task(self._ask_again(address, stranger, stranger.pause_s))
                self._waiting.add(again)
                again.add_done_callback(self._waiting.discard)
        else:
            self._known.pop(address, None)
            self._welcome(address)
        stranger.not_before_s = self._clock.now_s() + stranger.pause_s
        stranger.pause_s = min(2 * stranger.pause_s, _LONGEST_PAUSE_S)

    async def _ask_again(
        self, address: RobotAddress, stranger: UnverifiedRobot, pause_s: float
    ) -> None:
        await self._clock.pause(pause_s)
        if self._known.get(address) is stranger and self._clock.now_s() >= stranger.not_before_s:
            self._due[address] = None
            self._ask_next()
