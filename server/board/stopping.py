"""STOP for one robot: sent immediately on the open connection, and repeated until confirmed.

Only the teacher can release the robot: see docs/howto/class.md.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import secrets
from collections.abc import Callable, Coroutine
from enum import StrEnum
from typing import Any

from robot.clock import Clock
from server.board.teacher_session import TeacherSession
from server.board.transport import UnreachableError, within

log = logging.getLogger(__name__)

CONFIRM_S = 0.3
"""How long to wait for a stop's confirmation, in seconds, before it is sent another way."""
_STOP = json.dumps({"type": "stop"})


class Stopping(StrEnum):
    """The stages of a stop."""

    ASKED = "asked"
    STOPPED = "stopped"
    NOT_REACHED = "not_reached"


class RobotStop:
    """The stop of one robot; `on_change` is called at each new stage.

    Attributes:
        stage: The current stage; None if no stop was requested, or the last one was released.
        channel: The open connection to the robot; None while there is none.
        number: The number of the newest STOP that the robot has reported; None if there is none.
        pressed_s: When STOP was last pressed, on the clock.
        is_release_refused: True if the last release was for an older STOP than the newest.
    """

    def __init__(
        self, session: TeacherSession, clock: Clock, on_change: Callable[[], None]
    ) -> None:
        self.stage: Stopping | None = None
        self.channel: Any = None
        self.number: int | None = None
        self.is_release_refused = False
        self.pressed_s = -math.inf
        self._press = ""
        self._number_before: int | None = None
        """The value of `number` when this stop was requested."""
        self._is_shown = False
        """True once a state of the robot has shown this stop; earlier states are older."""
        self._confirmed: int | None = None
        """The robot's number for this stop, from the answer that confirmed it; None until then. A
        state with at least this number is newer than the stop."""
        self._session, self._clock = session, clock
        self._on_change = on_change
        self._pressing: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def is_under_way(self) -> bool:
        """True if the robot has not confirmed the stop."""
        return self.stage in (Stopping.ASKED, Stopping.NOT_REACHED)

    @property
    def id(self) -> str:
        """The id that a release of the stop must contain. The id changes with each press of STOP on
        the board, and with each new STOP that the robot reports."""
        return f"{self._press}.{self.number}"

    def press(self, now_s: float) -> None:
        """Stop the robot now, or as soon as the robot can be reached."""
        self._press, self.is_release_refused = secrets.token_hex(4), False
        self.pressed_s = now_s
        if self.channel is not None:
            self._start(self.send(self.channel))
        if not self.is_under_way:
            self.stage, self._is_shown, self._confirmed = Stopping.ASKED, False, None
            self._number_before = self.number
            if self._pressing is not None:
                self._pressing.cancel()
            self._pressing = self._start(self._see_to_it())
        self._on_change()

    def release(self, stop: str) -> None:
        """Let pupils start the robot again. Does nothing without a connection to the robot.

        `stop` is the `id` that the teacher has seen; a release of an older STOP is refused.
        """
        if self.channel is None:
            return
        if stop != self.id:
            self.is_release_refused = self.stage is not None
            self._on_change()
            return
        if self._pressing is not None:  # the task's next request would stop the robot again
            self._pressing.cancel()
        self.stage, self.is_release_refused = None, False
        words = json.dumps({"type": "release", "stop_number": self.number})
        self._start(self.send(self.channel, words))
        self._on_change()

    def refuse_release(self) -> None:
        """Report that a release came after a newer STOP, so the robot is still stopped."""
        self.is_release_refused = True
        if self.stage is None:  # the board believed that the stop was released
            self.stage, self._is_shown = Stopping.STOPPED, True
        self._on_change()

    def note_state(self, number: int | None, *, is_stopped: bool) -> None:
        """Process a state from the robot, which the robot may have sent before the last command."""
        self.number = max(self.number or 0, number or 0) or None
        if not is_stopped:
            self.is_release_refused = False
            confirmed = self._confirmed
            is_later = number is not None and confirmed is not None and number >= confirmed
            if self.stage is Stopping.STOPPED and (self._is_shown or is_later):
                self.stage = None  # the stop was released
        elif self.stage is not None and (number is None or number != self._number_before):
            self.stage, self._is_shown = Stopping.STOPPED, True

    async def send_again(self, channel: Any) -> None:
        """Call this when the robot is connected again; sends a stop that was not released."""
        self._is_shown = False
        # forget the number, because a robot that has restarted begins with another one
        self.number = self._confirmed = None
        if self.stage is not None:
            await self.send(channel)

    async def send(self, channel: Any, words: str = _STOP) -> None:
        """Send the stop on an open connection; if this fails, no confirmation comes."""
        with contextlib.suppress(UnreachableError):
            async with within(1.0):
                await channel.send(words)

    def close(self) -> None:
        for task in self._tasks:
            task.cancel()

    async def _see_to_it(self) -> None:
        """Wait until the stop is confirmed; report and repeat an unconfirmed stop."""
        await self._clock.pause(CONFIRM_S)
        while self.is_under_way:
            if self.stage is Stopping.ASKED:
                log.warning("stop not confirmed robot=%s", self._session.address)
                self.stage = Stopping.NOT_REACHED
                self._on_change()
            with contextlib.suppress(UnreachableError):
                async with within():
                    # Send the stop on a new connection: the open one may be dead without an error.
                    answer = await self._session.send("POST", "/api/stop")
                stopped = answer.json()
                if stopped.get("emergency") is True and self.stage is not None:
                    self.stage = Stopping.STOPPED
                    number = stopped.get("stop_number")
                    self._confirmed = number if type(number) is int else None
                    self.number = self._confirmed or self.number
                    self._on_change()
            await self._clock.pause(1.0)

    def _start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
