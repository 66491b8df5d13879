"""The board's connection to one robot: it stays open, so that a stop is one message away.

The board is a client of the robot's own server, like a page: it hears the state on `/ws/drive` as
an idle client, and gets pictures on `/ws/video` only while somebody looks. A robot that is slow or
gone delays no other: each has tasks of its own, and nothing is shared between them.
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
from server.board.teacher_session import RefusedError, Status, TeacherSession, WrongClassError
from server.board.transport import (
    Channel,
    HttpAnswer,
    RobotAddress,
    ServerPlace,
    Transport,
    UnreachableError,
)
from server.protocol import ProtocolError, encode_acknowledgement, parse_picture
from server.security.class_key import ClassKey

log = logging.getLogger(__name__)

CONFIRM_S = 0.3
"""A stop that is not confirmed in this time is reported, and sent again by another way."""
PING_EVERY_S, SILENCE_S = 1.0, 3.0
_RETRY_S, _LONGEST_RETRY_S, _STOP_RETRY_S = 0.5, 5.0, 0.25
_PATIENCE_S = 5.0
_INVITE_EVERY_S = 100.0
_STOP = json.dumps({"type": "stop"})
_FIELDS = (
    *("mode", "driven_by", "action", "stop_reason", "emergency", "asks_pilot", "fault", "link"),
    *("agreement", "lessons", "battery", "pilot", "viewers"),
)


class Stopping(StrEnum):
    """How far a stop has come."""

    ASKED = "asked"
    STOPPED = "stopped"
    NOT_REACHED = "not_reached"


class RobotLink:
    """One robot on the board.

    Args:
        number: Its number on the board.
        address: Where its server is.
        key: The class's key.
        transport: Reaches it.
        clock: All waiting goes through it.
        on_news: Called when something about the robot has changed.
        on_picture: Called with each message of `/ws/video`.
    """

    def __init__(
        self,
        number: int,
        address: RobotAddress,
        key: ClassKey,
        transport: Transport,
        clock: Clock,
        on_news: Callable[[RobotLink], None],
        on_picture: Callable[[RobotLink, bytes], None],
    ) -> None:
        self.number, self.address = number, address
        self.status, self.detail = Status.CONNECTING, ""
        self.name = f"{address.host}:{address.port}"
        self.about: dict[str, Any] = {}
        self.state: dict[str, Any] = {}
        self.delay_ms: float | None = None
        self.invitation: str | None = None
        self.invitations = 0
        self.stopping: Stopping | None = None
        self._session = TeacherSession(address, key, transport)
        self._transport, self._clock = transport, clock
        self._on_news, self._on_picture = on_news, on_picture
        self._channel: Channel | None = None
        self._every_s: float | None = None
        self._rate_changed = asyncio.Event()
        self._hurry = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        self._pressing: asyncio.Task[None] | None = None
        self._was_there = False
        self._heard_s = 0.0

    # What others ask ---------------------------------------------------------------------------

    def describe(self) -> dict[str, Any]:
        """Return what the page shows of this robot."""
        place = self._session.place.address if self._session.place is not None else self.address
        return {
            "number": self.number,
            "address": str(place),
            "name": self.name,
            "status": self.status.value,
            "detail": self.detail,
            "stop": self.stopping.value if self.stopping is not None else None,
            "delay_ms": self.delay_ms,
            "invitations": self.invitations,
            "colour": self.about.get("colour"),
            "locks": self.about.get("locks", []),
            "model": self.about.get("model"),
            **{name: self.state.get(name) for name in _FIELDS},
        }

    @property
    def page_address(self) -> str | None:
        """What the robot's QR code says; None before there is one."""
        if self._session.place is None or self.status is not Status.THERE:
            return None
        if not self.about.get("needs_pairing"):
            return str(self._session.place.address)
        return f"{self._session.place.address}/pair#{self.invitation}" if self.invitation else None

    def stop(self) -> None:
        """Stop the robot now; while it cannot be reached, as soon as it can."""
        self.stopping = Stopping.ASKED
        if self._pressing is None or self._pressing.done():
            self._pressing = self._start(self._press())
        if self._channel is not None:
            self._start(self._send_stop(self._channel))
        self._hurry.set()
        self._on_news(self)

    def show(self, every_s: float | None) -> None:
        """Get a picture in so many seconds; None for none at all."""
        if every_s != self._every_s:
            self._every_s = every_s
            self._rate_changed.set()

    async def ask(self, method: str, path: str, body: Any = None) -> HttpAnswer:
        """Send a request as the teacher; see `TeacherSession.ask`."""
        return await self._session.ask(method, path, body)

    async def refresh(self) -> None:
        """Ask for name, colour, locks and model again."""
        self.about = (await self.ask("GET", "/api/class")).json()
        self.name = str(self.about.get("name", self.name))
        self._on_news(self)

    # The connection ----------------------------------------------------------------------------

    async def run(self) -> None:
        """Stay connected until cancelled."""
        retry_s = _RETRY_S
        try:
            while True:
                try:
                    await self._serve()
                except WrongClassError as error:
                    self._lose(error.status, str(error))
                except RefusedError as error:
                    self._lose(Status.AWAY, str(error))
                except (UnreachableError, TimeoutError) as error:
                    self._lose(Status.AWAY, str(error) or "it does not answer in time")
                except (ValueError, KeyError, TypeError) as error:
                    self._lose(Status.AWAY, f"its answer makes no sense: {error!r}"[:300])
                was_there, self._was_there = self._was_there, False
                retry_s = _RETRY_S if was_there else min(2 * retry_s, _LONGEST_RETRY_S)
                if self.stopping in (Stopping.ASKED, Stopping.NOT_REACHED):
                    retry_s = _STOP_RETRY_S
                self._hurry.clear()
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._hurry.wait(), retry_s)
        finally:
            for task in self._tasks:
                task.cancel()

    def _lose(self, status: Status, detail: str) -> None:
        if (status, detail) != (self.status, self.detail):
            log.warning("robot=%s status=%s detail=%r", self.address, status.value, detail)
        self.status, self.detail, self._channel, self.delay_ms = status, detail, None, None
        self._on_news(self)

    async def _serve(self) -> None:
        """Connect once, and stay until the connection ends."""
        async with asyncio.timeout(_PATIENCE_S):
            if not self._session.is_open:
                await self._session.join()
            try:
                await self.refresh()
            except RefusedError:
                self._session.forget()  # it was started anew, perhaps without the key
                raise
        place = self._session.place
        assert place is not None
        async with self._transport.connect(place, "/ws/drive", self._session.headers) as channel:
            if self.stopping is not None:
                await self._send_stop(channel)
            await channel.send(json.dumps({"type": "idle"}))
            self._channel, self._was_there = channel, True
            self.status, self.detail = Status.THERE, ""
            self._heard_s = self._clock.now_s()
            self._on_news(self)
            await _first_of(
                self._hear(channel), self._ping(channel), self._look(place), self._invite()
            )

    # While it is open --------------------------------------------------------------------------

    async def _hear(self, channel: Channel) -> None:
        while True:
            text = await channel.receive()
            self._heard_s = self._clock.now_s()
            message = json.loads(text)
            kind = message.get("type")
            if kind == "state":
                self._note_state(message)
            elif kind == "pong":
                self.delay_ms = round(self._clock.now_s() * 1000 - float(message["client_ms"]), 1)
            elif kind == "event":
                self._note_event(message)

    def _note_state(self, state: dict[str, Any]) -> None:
        known = {name: state.get(name) for name in _FIELDS}
        if state.get("emergency") is True and self.stopping is not None:
            self.stopping = Stopping.STOPPED
        elif self.stopping is Stopping.STOPPED:
            self.stopping = None  # released on a phone
        self.state = known
        self._on_news(self)

    def _note_event(self, event: dict[str, Any]) -> None:
        name = event.get("name")
        if name == "renamed":
            self.about["colour"] = event.get("colour")
            self.name = str(event.get("robot", self.name))
        elif name == "locked":
            self.about["locks"] = event.get("locks", [])
        elif name in ("model_saved", "model_loaded"):
            self.about["model"] = event.get("model")
        self._on_news(self)

    async def _ping(self, channel: Channel) -> None:
        while True:
            words = {"type": "ping", "client_ms": self._clock.now_s() * 1000}
            async with asyncio.timeout(SILENCE_S):
                await channel.send(json.dumps(words))
            await self._clock.pause(PING_EVERY_S)
            if self._clock.now_s() - self._heard_s > SILENCE_S:
                raise UnreachableError("it has fallen silent")

    async def _invite(self) -> None:
        """Keep a token for the QR code that stays valid for a while yet."""
        while True:
            token = (await self.ask("POST", "/api/class/invitation", {})).json().get("token")
            self.invitation = token if isinstance(token, str) else None
            self.invitations += 1
            self._on_news(self)
            await self._clock.pause(_INVITE_EVERY_S)

    async def _look(self, place: ServerPlace) -> None:
        """Get pictures while somebody looks."""
        while True:
            self._rate_changed.clear()
            if self._every_s is None:
                await self._rate_changed.wait()
                continue
            path = f"/ws/video?every_ms={round(self._every_s * 1000)}"
            try:
                async with self._transport.connect(place, path, self._session.headers) as channel:
                    await _first_of(self._take_pictures(channel), self._wait_for_change())
            except UnreachableError:
                await self._clock.pause(_RETRY_S)

    async def _wait_for_change(self) -> None:
        await self._rate_changed.wait()

    async def _take_pictures(self, channel: Channel) -> None:
        while True:
            message = await channel.receive()
            try:
                picture = parse_picture(message if isinstance(message, bytes) else b"")
            except ProtocolError as error:
                raise UnreachableError(f"its picture makes no sense: {error}") from error
            if not picture.quiet:
                await channel.send(encode_acknowledgement(picture.frame_id))
            assert isinstance(message, bytes)
            self._on_picture(self, message)

    # Stopping ----------------------------------------------------------------------------------

    async def _send_stop(self, channel: Channel) -> None:
        with contextlib.suppress(UnreachableError, TimeoutError):
            async with asyncio.timeout(1.0):
                await channel.send(_STOP)
                # An idle client hears of changes only; one that was stopped already tells of none.
                await channel.send(json.dumps({"type": "watch"}))
                await channel.send(json.dumps({"type": "idle"}))

    async def _press(self) -> None:
        """See to it that a stop is confirmed, and report it if it is not."""
        await self._clock.pause(CONFIRM_S)
        while self.stopping in (Stopping.ASKED, Stopping.NOT_REACHED):
            if self.stopping is Stopping.ASKED:
                log.warning("stop not confirmed robot=%s", self.address)
                self.stopping = Stopping.NOT_REACHED
                self._on_news(self)
            with contextlib.suppress(UnreachableError, TimeoutError):
                await self._stop_by_request()
            await self._clock.pause(1.0)

    async def _stop_by_request(self) -> None:
        """Stop on a connection of its own: the open one may be dead without knowing it."""
        if self._session.place is None:
            return
        async with asyncio.timeout(_PATIENCE_S):
            answer = await self._transport.request(
                self._session.place, "POST", "/api/stop", self._session.headers
            )
        if answer.json().get("emergency") is True and self.stopping is not None:
            self.stopping = Stopping.STOPPED
            self._on_news(self)

    def _start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task


async def _first_of(*works: Coroutine[Any, Any, None]) -> None:
    """Run until the first ends; end the others and pass its error on."""
    tasks = [asyncio.create_task(work) for work in works]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()
