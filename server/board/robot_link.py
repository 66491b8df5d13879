"""The board's connection to one robot, which stays open so that a stop takes one message.

The board is a client of the robot's server, as a page is. The board receives the robot's state on
`/ws/drive`, and pictures on `/ws/video` while a page shows them. Each robot has its own tasks, so a
slow or missing robot does not delay the others.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from robot.clock import Clock
from robot.errors import UNREADABLE, RobotError, told_as
from server.access.banner import pairing_address
from server.board.classroom import TEACHER
from server.board.stopping import RobotStop
from server.board.teacher_session import RefusedError, Status, TeacherSession, WrongClassError
from server.board.transport import HERE, RobotAddress, UnreachableError, within
from server.protocol import (
    ErrorCode,
    ProtocolError,
    encode_acknowledgement,
    parse_object,
    parse_picture,
)
from server.routes.sockets import first_of

log = logging.getLogger(__name__)

PING_EVERY_S, SILENCE_S = 1.0, 3.0
START_S = 30.0
"""Time for which a robot that has never answered counts as starting, in seconds."""
_RETRY_S, _LONGEST_RETRY_S, _STOP_RETRY_S = 0.5, 5.0, 0.25
_STARTING_RETRY_S = 1.0
"""Longest time between two attempts to connect to a robot that may still be starting, in seconds.
The time is short, so that the robots of a new class appear soon."""
_INVITE_EVERY_S, _INVITE_AGAIN_S = 100.0, 10.0
_FIELDS = (
    *("mode", "driven_by", "action", "stop_reason", "emergency", "asks_pilot", "fault", "link"),
    *("busy", "agreement", "lessons", "battery", "pilot", "viewers", "stop_held_by"),
)


class RobotLink:
    """One robot on the board.

    Args:
        number: The robot's number on the board.
        session: The teacher's session with the robot.
        clock: The clock.
        on_news: Called with this link when something about the robot has changed.
        on_picture: Called with this link and each message of `/ws/video`.
        at_leisure: Cleared while a stop is under way; no further pictures are then requested.
    """

    def __init__(
        self,
        number: int,
        session: TeacherSession,
        clock: Clock,
        on_news: Callable[[RobotLink], None],
        on_picture: Callable[[RobotLink, bytes], None],
        at_leisure: asyncio.Event,
    ) -> None:
        self.number, self.address = number, session.address
        self.status, self.detail = Status.CONNECTING, ""
        self.name = f"{self.address.host}:{self.address.port}"
        self.about: dict[str, Any] = {}
        self.state: dict[str, Any] = {}
        self.delay_ms: float | None = None
        self.invitation: str | None = None
        self.invitations = 0
        self._session, self.ask = session, session.ask
        self.stop = RobotStop(self._session, clock, self._note_stop)
        self._clock = clock
        self._on_news, self._on_picture = on_news, on_picture
        self._at_leisure = at_leisure
        self._every_s: float | None = None
        self._rate_changed = asyncio.Event()
        self._hurry = asyncio.Event()
        self._was_there, self._is_starting = False, True
        self._added_s = clock.now_s()
        self.own_host: str | None = None
        """This computer's address for phones, in place of 127.0.0.1; None if it has none."""
        self.joined_s = self.heard_s = -math.inf
        """When the last connection was opened, and when the robot was last heard from."""

    @property
    def id(self) -> str | None:
        """The robot's id, which stays the same if its address changes; None if it is not known."""
        return self._text("id")

    @property
    def run_id(self) -> str | None:
        """The id of the robot's process; None if it is not known."""
        return self._text("run")

    def _text(self, field: str) -> str | None:
        value = self.about.get(field)
        return value if isinstance(value, str) else None

    @property
    def _place(self) -> RobotAddress:
        return self._session.place.address if self._session.place is not None else self.address

    @property
    def page(self) -> str:
        """The address at which phones open the robot's page."""
        is_here = self._place.host == HERE and self.about.get("needs_pairing")
        return str(replace(self._place, host=self.own_host or HERE) if is_here else self._place)

    def describe(self) -> dict[str, Any]:
        return {
            "number": self.number,
            "address": str(self._place),
            "page": self.page,
            "name": self.name,
            "status": self.status.value,
            "detail": self.detail,
            "stop": self.stop.stage.value if self.stop.stage is not None else None,
            "stop_id": self.stop.id,
            "release_refused": self.stop.is_release_refused,
            "delay_ms": self.delay_ms,
            "invitations": self.invitations,
            "colour": self.about.get("colour"),
            "locks": self.about.get("locks", []),
            "model": self.about.get("model"),
            "shown": self.about.get("shown", {}),
            **{name: self.state.get(name) for name in _FIELDS},
        }

    def page_address(self, *, printed: bool = False) -> str | None:
        """The address in the robot's QR code; None if there is no code yet."""
        if self._session.place is None or self.status is not Status.THERE:
            return None
        token = self._session.key.code if printed else self.invitation
        if not self.about.get("needs_pairing"):
            return self.page
        return pairing_address(self.page, token) if token else None

    def show(self, every_s: float | None) -> None:
        """From now on, receive a picture every `every_s` seconds, or no pictures if it is None."""
        if every_s != self._every_s:
            self._every_s = every_s
            self._rate_changed.set()

    async def refresh(self) -> None:
        answer = await self.ask("GET", "/api/class")
        self.heard_s = self._clock.now_s()
        self.about = answer.json()
        self.name = str(self.about.get("name", self.name))
        self._on_news(self)

    async def run(self) -> None:
        retry_s = _RETRY_S
        try:
            while True:
                try:
                    await self._serve()
                except WrongClassError as error:
                    self._lose(error.status, str(error))
                except RobotError as error:
                    self._lose(Status.AWAY, str(error))
                except UNREADABLE as error:
                    self._lose(Status.AWAY, f"the robot's answer is not valid: {error!r}"[:300])
                was_there, self._was_there = self._was_there, False
                longest_s = _STARTING_RETRY_S if self._is_starting else _LONGEST_RETRY_S
                retry_s = _RETRY_S if was_there else min(2 * retry_s, longest_s)
                if self.stop.is_under_way:
                    retry_s = _STOP_RETRY_S
                self._hurry.clear()
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._hurry.wait(), retry_s)
        finally:
            self.stop.close()

    def _lose(self, status: Status, detail: str) -> None:
        if (status, detail) != (self.status, self.detail) or self._is_starting:
            age_s = self._clock.now_s() - self._added_s
            self._is_starting = self._is_starting and status is Status.AWAY and age_s < START_S
            level = logging.DEBUG if self._is_starting else logging.WARNING
            log.log(level, "robot=%s status=%s detail=%r", self.address, status.value, detail)
        self.status, self.detail, self.delay_ms = status, detail, None
        self.stop.channel = None
        self._on_news(self)

    async def _serve(self) -> None:
        """Connect to the robot, and exchange messages until the connection ends."""
        async with within():
            if not self._session.is_open:
                await self._session.join()
            try:
                await self.refresh()
            except RefusedError:
                self._session.forget()  # the robot has restarted, perhaps without the class key
                raise
            except UnreachableError:
                self._session.doubt()  # look the robot's name up again
                raise
        async with self._session.connect("/ws/drive") as channel:
            await self.stop.send_again(channel)
            await channel.send(json.dumps({"type": "idle"}))
            self.stop.channel, self._was_there = channel, True
            self._is_starting = False
            self.status, self.detail = Status.THERE, ""
            self.joined_s = self.heard_s = self._clock.now_s()
            self._on_news(self)
            async with within():
                await self.refresh()  # no event reports changes from before the connection was open
            await first_of(self._hear(channel), self._ping(channel), self._look(), self._invite())

    def _note_stop(self) -> None:
        self._hurry.set()
        self._on_news(self)

    async def _hear(self, channel: Any) -> None:
        while True:
            message = parse_object(await channel.recv())
            self.heard_s = self._clock.now_s()
            kind = message.get("type")
            if kind == "state":
                self._note_state(message)
            elif kind == "pong":
                self.delay_ms = round(self._clock.now_s() * 1000 - float(message["client_ms"]), 1)
            elif kind == "event":
                self._note_event(message)
            elif kind == "error" and message.get("code") == ErrorCode.NEWER_STOP:
                self.stop.refuse_release()

    def _note_state(self, state: dict[str, Any]) -> None:
        is_ours = state.get("stop_held_by") == TEACHER.value  # a pupil may have stopped the robot
        is_stopped = is_ours and state.get("emergency") is True
        number = state.get("stop_number")
        self.stop.note_state(number if type(number) is int else None, is_stopped=is_stopped)
        self.state = {name: state.get(name) for name in _FIELDS}
        self._on_news(self)

    def _note_event(self, event: dict[str, Any]) -> None:
        name = event.get("name")
        if name == "renamed":
            self.about["colour"] = event.get("colour")
            self.name = str(event.get("robot", self.name))
        elif name == "shown":
            self.about["shown"] = event.get("shown", {})
        elif name == "locked":
            self.about["locks"] = event.get("locks", [])
        elif name in ("model_saved", "model_loaded"):
            self.about["model"] = event.get("model")
        self._on_news(self)

    async def _ping(self, channel: Any) -> None:
        while True:
            words = {"type": "ping", "client_ms": self._clock.now_s() * 1000}
            async with within(SILENCE_S):
                await channel.send(json.dumps(words))
            await self._clock.pause(PING_EVERY_S)
            if self._clock.now_s() - self.heard_s > SILENCE_S:
                raise UnreachableError("the robot no longer answers")

    async def _invite(self) -> None:
        """Renew the QR code's token before it expires.

        A failed request does not end the open connection, so a STOP can still be sent on it.
        """
        while True:
            pause_s = _INVITE_EVERY_S
            try:
                if not self._session.is_open:
                    await self._session.join()
                token = (await self.ask("POST", "/api/class/invitation", {})).json().get("token")
                self.invitation = token if isinstance(token, str) else None
                self.invitations += 1
                self._on_news(self)
            except RobotError as error:
                log.debug("robot=%s no invitation: %s", self.address, error)
                if isinstance(error, UnreachableError):
                    self._session.doubt()  # the robot may have renewed its certificate
                pause_s = _INVITE_AGAIN_S
            await self._clock.pause(pause_s)

    async def _look(self) -> None:
        while True:
            self._rate_changed.clear()
            if self._every_s is None:
                await self._rate_changed.wait()
                continue
            path = f"/ws/video?every_ms={round(self._every_s * 1000)}"
            try:
                async with self._session.connect(path) as channel:
                    await first_of(self._take_pictures(channel), self._rate_changed.wait())
            except UnreachableError:
                await self._clock.pause(_RETRY_S)

    async def _take_pictures(self, channel: Any) -> None:
        while True:
            message = await channel.recv()
            with told_as(UnreachableError, "the robot sent an invalid picture", ProtocolError):
                picture = parse_picture(message if isinstance(message, bytes) else b"")
            # the robot sends the next picture after this acknowledgement
            await self._at_leisure.wait()
            if not picture.quiet:
                await channel.send(encode_acknowledgement(picture.frame_id))
            assert isinstance(message, bytes)
            self._on_picture(self, message)
