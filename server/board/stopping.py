"""STOP for one robot: sent on the open line at once, confirmed by the robot, or repeated and told.

A stop is the teacher's until the teacher releases it: see docs/howto/class.md.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import Callable, Coroutine
from enum import StrEnum
from typing import Any

from robot.clock import Clock
from server.board.teacher_session import TeacherSession
from server.board.transport import UnreachableError, within

log = logging.getLogger(__name__)

CONFIRM_S = 0.3
"""A stop that is not confirmed in this time is reported, and sent again by another way."""
_STOP, _RELEASE = json.dumps({"type": "stop"}), json.dumps({"type": "release"})


class Stopping(StrEnum):
    """How far a stop has come."""

    ASKED = "asked"
    STOPPED = "stopped"
    NOT_REACHED = "not_reached"


class RobotStop:
    """The stop of one robot; `on_change` is called when it has come further.

    Attributes:
        stage: How far it has come; None where nothing was asked, or it was released.
        channel: The open line to the robot; None while there is none.
    """

    def __init__(
        self, session: TeacherSession, clock: Clock, on_change: Callable[[], None]
    ) -> None:
        self.stage: Stopping | None = None
        self.channel: Any = None
        self._is_shown = False
        """Whether the line has told of this stop: what comes before that is older than it."""
        self._is_behind = False
        """Whether the line may still tell of a stop that was released since."""
        self._session, self._clock = session, clock
        self._on_change = on_change
        self._pressing: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def is_under_way(self) -> bool:
        """True if the robot has not confirmed the stop."""
        return self.stage in (Stopping.ASKED, Stopping.NOT_REACHED)

    def press(self) -> None:
        """Stop the robot now; while it cannot be reached, as soon as it can."""
        if self.channel is not None:
            self._start(self.send(self.channel))
        if not self.is_under_way:
            self.stage, self._is_shown = Stopping.ASKED, False
            if self._pressing is not None:
                self._pressing.cancel()
            self._pressing = self._start(self._see_to_it())
        self._on_change()

    def release(self) -> None:
        """Let the robot's pupils start it again; one that is away stays stopped."""
        if self.channel is None:
            return
        if self._pressing is not None:  # what it has asked for would come after the release
            self._pressing.cancel()
        self.stage, self._is_behind = None, True
        self._start(self.send(self.channel, _RELEASE))
        self._on_change()

    def note_state(self, *, is_stopped: bool) -> None:
        """Take in what the robot says on the line, which may be older than what it was told."""
        if not is_stopped:
            self._is_behind = False
            if self.stage is Stopping.STOPPED and self._is_shown:
                self.stage = None  # released
        elif self.stage is not None and not self._is_behind:
            self.stage, self._is_shown = Stopping.STOPPED, True

    async def send_again(self, channel: Any) -> None:
        """Send what is not released on a line that has just been opened, before all else."""
        self._is_shown = self._is_behind = False
        if self.stage is not None:
            await self.send(channel)

    async def send(self, channel: Any, words: str = _STOP) -> None:
        """Say it on an open line; a stop that fails here is noticed where it is confirmed."""
        with contextlib.suppress(UnreachableError):
            async with within(1.0):
                await channel.send(words)

    def close(self) -> None:
        for task in self._tasks:
            task.cancel()

    async def _see_to_it(self) -> None:
        """See to it that the stop is confirmed, and report it if it is not."""
        await self._clock.pause(CONFIRM_S)
        while self.is_under_way:
            if self.stage is Stopping.ASKED:
                log.warning("stop not confirmed robot=%s", self._session.address)
                self.stage = Stopping.NOT_REACHED
                self._on_change()
            with contextlib.suppress(UnreachableError):
                async with within():
                    # The open connection may be dead without knowing it: this is one of its own.
                    answer = await self._session.send("POST", "/api/stop")
                if answer.json().get("emergency") is True and self.stage is not None:
                    self.stage = Stopping.STOPPED
                    self._on_change()
            await self._clock.pause(1.0)

    def _start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
