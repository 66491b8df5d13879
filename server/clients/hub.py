"""The clients of one robot: who is connected, who drives, and what is published to them.

Everything runs on the server's event loop; the control loop's thread only hands over its newest
tick. Nothing in this module decides about motors: that is the gate's, in robot/.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import itertools
import logging
from collections import Counter
from collections.abc import AsyncGenerator, Callable

from robot.control.state import Tick
from robot.moves import describe as describe_moves
from robot.rig.rig import Rig
from robot.types import Frame, Mode, PilotCommand
from server import protocol
from server.clients.client import Client
from server.clients.freshness import NonceLedger
from server.clients.lease import Lease
from server.clients.telemetry import describe
from server.clients.video import Encoder, VideoHub, Viewer
from server.config import Config
from server.events import EventBus
from server.protocol import ErrorCode, ProtocolError
from server.security.access import Role

log = logging.getLogger(__name__)

STATE_EVERY_S = 0.1


class Hub:
    """The server's side of one robot."""

    def __init__(self, config: Config, robot: Rig, name: str, events: EventBus) -> None:
        self.config = config
        self.robot = robot
        self.clock = robot.clock
        self.name = name
        self.video = VideoHub(Encoder(config.jpeg_quality), robot.clock)
        self.lease = Lease(config.lease_lapse_s)
        self.nonces = NonceLedger()
        self.refused: Counter[ErrorCode] = Counter()
        self.pages: dict[str, Client] = {}
        driver = robot.driver
        self._declared_moves = describe_moves(driver.moves, driver.declared_moves)
        self._ids = itertools.count(1)
        self._told: object = None
        self._told_s = 0.0
        self._frame: Frame | None = None
        self._is_tick_due = False
        self._events = events
        self._unsubscribe: list[Callable[[], None]] = []
        self._tasks: list[asyncio.Task[None]] = []
        self._event_loop: asyncio.AbstractEventLoop | None = None

    # Life --------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Begin to listen to the robot's loop."""
        event_loop = self._event_loop = asyncio.get_running_loop()

        def on_tick(tick: Tick) -> None:  # on the control loop's thread
            if tick.frame is not None:
                self._frame = tick.frame
            if not self._is_tick_due and (self.pages or self.video.viewers):
                self._is_tick_due = True
                with contextlib.suppress(RuntimeError):  # the server has just ended
                    event_loop.call_soon_threadsafe(self._note_tick)

        def on_event(name: str, fields: dict[str, object]) -> None:  # on any thread
            with contextlib.suppress(RuntimeError):  # the server has just ended
                event_loop.call_soon_threadsafe(functools.partial(self.announce, name, **fields))

        self._unsubscribe = [self.robot.loop.subscribe(on_tick), self._events.subscribe(on_event)]
        self._tasks = [asyncio.create_task(self._keep_time())]

    async def stop(self) -> None:
        """Stop listening, and stop the robot if somebody drove it from here."""
        for unsubscribe in self._unsubscribe:
            unsubscribe()
        self.robot.loop.empty_command()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def tasks(self) -> int:
        """Return how many tasks the server's event loop has: none may stay behind its page."""
        return len(asyncio.all_tasks(self._event_loop)) if self._event_loop else 0

    # Pages -------------------------------------------------------------------------------------

    def join(self, role: Role) -> Client:
        """Let a page in; it gets the wheel if it may and the wheel is free."""
        now_s = self.clock.now_s()
        page = Client(f"c{next(self._ids)}", role, self.config, now_s)
        self.pages[page.client] = page
        page.tell(
            protocol.encode_words(
                "hello",
                protocol=protocol.PROTOCOL_VERSION,
                client=page.client,
                role=role.value,
                robot=self.name,
                moves=list(self.robot.loop.state.moves),
                declared_moves=[move.describe() for move in self._declared_moves],
                server_ms=self.now_ms(),
            )
        )
        for name, fields in self._events.lasting:
            page.tell(protocol.encode_words("event", name=name, **fields))
        if role is Role.PILOT and self.lease.join(page.client, now_s):
            self._change_hands()
        self.publish_state()
        log.info("join client=%s role=%s pilot=%s", page.client, role.value, self.lease.owner)
        return page

    def watch(self, viewer: Viewer) -> None:
        """Let a viewer of the picture in; it sees the newest frame at once."""
        self._show_newest()
        self.video.add(viewer)

    async def stream(self) -> AsyncGenerator[bytes, None]:
        """Yield the newest frames as JPEG, for as long as they are asked for."""
        self._show_newest()
        async with contextlib.aclosing(self.video.stream()) as frames:
            async for jpeg in frames:
                yield jpeg

    def leave(self, page: Client) -> None:
        """A page is gone; if it had the wheel the robot stops now."""
        self.pages.pop(page.client, None)
        now_s = self.clock.now_s()
        if self.lease.give_up(page.client, now_s):
            self._offer_wheel(now_s)
            self._change_hands()
        self.publish_state()
        log.info("leave client=%s refused=%d", page.client, page.refused)

    def _offer_wheel(self, now_s: float) -> None:
        """Give a wheel that nobody has or asked for to the only page that may drive: as a rule the
        same pilot, come back while the line that it lost was still being closed."""
        drivers = [page for page in self.pages.values() if page.role is Role.PILOT]
        if self.lease.owner is None and len(drivers) == 1:
            self.lease.join(drivers[0].client, now_s)

    def hear(self, page: Client, text: str) -> None:
        """Act on one message of a page; what is refused is answered and counted."""
        now_s = self.clock.now_s()
        page.last_word_s = now_s
        try:
            if not page.pace.allows(now_s) and not protocol.is_stop(text):
                raise ProtocolError(ErrorCode.TOO_FAST, "too many messages a second")
            self._obey(page, protocol.parse_message(text, self.robot.loop.state.moves), now_s)
        except ProtocolError as error:
            self.refuse(page, error)

    def refuse(self, page: Client, error: ProtocolError) -> None:
        """Answer a refused message, and count it."""
        page.refused += 1
        self.refused[error.code] += 1
        page.tell(protocol.encode_error(error))

    def _obey(self, page: Client, word: protocol.ClientMessage, now_s: float) -> None:
        loop = self.robot.loop
        if isinstance(word, protocol.DriveMessage):
            self._obey_drive(page, word, now_s)
        elif isinstance(word, protocol.ModeMessage):
            self._obey_mode(page, word, now_s)
        elif isinstance(word, protocol.Ping):
            page.tell(
                protocol.encode_words("pong", client_ms=word.client_ms, server_ms=self.now_ms())
            )
        elif isinstance(word, protocol.Stop):
            self.stop_at_once(page.client)
        elif isinstance(word, protocol.Release):
            self._require_wheel(page)
            loop.release_emergency()
            log.info("release client=%s", page.client)
        elif isinstance(word, protocol.Take):
            self._obey_take(page, now_s)
        elif isinstance(word, protocol.Idle | protocol.Watch):
            page.is_idle = isinstance(word, protocol.Idle)
            if not page.is_idle:
                self.publish_state()  # with a fresh nonce
        elif self.lease.give_up(page.client, now_s):
            self._change_hands()

    def stop_at_once(self, client: str) -> None:
        """Latch the emergency stop, whoever asks."""
        self.robot.loop.latch_emergency()
        log.warning("emergency client=%s", client)

    def _obey_mode(self, page: Client, word: protocol.ModeMessage, now_s: float) -> None:
        page.order.check(word.seq)
        self._require_wheel(page, word.seq)
        self.lease.renew(page.client, now_s)
        if word.mode is not Mode.STOPPED:
            self._require_taken(word.frame, word.seq)
            self._require_sight(word)
        self.robot.loop.set_mode(
            word.mode, proven_s=self.nonces.issued_s(word.nonce), frame_id=word.frame
        )
        log.info("mode client=%s mode=%s", page.client, word.mode.value)

    def _require_taken(self, frame: int | None, seq: int) -> None:
        if frame is not None and frame > (self.robot.loop.state.frame_id or 0):
            raise ProtocolError(
                ErrorCode.UNKNOWN_FRAME, f"frame {frame} has not been taken yet", seq
            )

    def _require_sight(self, word: protocol.DriveMessage | protocol.ModeMessage) -> None:
        """Refuse what would be refused by the loop, and say why."""
        if word.frame is None:
            raise ProtocolError(
                ErrorCode.NO_PICTURE,
                "'frame' must name the picture on the screen: nobody drives who sees nothing",
                word.seq,
            )
        limit_s = self.robot.loop.config.gate.command_timeout_s
        if self.robot.clock.now_s() - self.nonces.issued_s(word.nonce) > limit_s:
            raise ProtocolError(
                ErrorCode.STALE,
                f"'nonce' is none of the last {1000 * limit_s:.0f} ms: this came too late",
                word.seq,
            )

    def _obey_drive(self, page: Client, word: protocol.DriveMessage, now_s: float) -> None:
        page.order.check(word.seq)
        self._require_wheel(page, word.seq)
        self._require_taken(word.frame, word.seq)
        self.lease.renew(page.client, now_s)
        self.robot.loop.command(
            PilotCommand(
                held=word.held,
                frame_id=word.frame,
                seq=word.seq,
                received_s=self.clock.now_s(),
                pilot=page.client,
                frame_age_s=None if word.frame_age_ms is None else word.frame_age_ms / 1000,
                phone_s=None if word.phone_ms is None else word.phone_ms / 1000,
                proven_s=self.nonces.issued_s(word.nonce),
            )
        )
        # The loop judges it again; here the client learns why it will be refused.
        if self.robot.loop.state.decision.mode is not Mode.STOPPED:
            self._require_sight(word)

    def _obey_take(self, page: Client, now_s: float) -> None:
        if page.role is not Role.PILOT:
            raise ProtocolError(ErrorCode.NOT_PILOT, "this browser was paired as a viewer")
        before = self.lease.owner
        if not self.lease.take(page.client, now_s):
            owner = self.pages.get(before or "")
            if owner is not None:
                owner.tell(protocol.encode_words("event", name="wheel_asked", client=page.client))
            page.tell(protocol.encode_words("event", name="wheel_waiting", pilot=before))
        elif before != page.client:
            self._change_hands()

    def _require_wheel(self, page: Client, seq: int | None = None) -> None:
        if self.lease.owner != page.client:
            raise ProtocolError(ErrorCode.NOT_PILOT, "somebody else has the wheel", seq)

    def _change_hands(self) -> None:
        """The wheel went to somebody else, or to nobody: what was held counts no more."""
        self.robot.loop.empty_command()
        log.info("wheel pilot=%s", self.lease.owner)
        self.publish_state()

    # What pages are told -----------------------------------------------------------------------

    def announce(self, name: str, **fields: object) -> None:
        """Tell every page that something happened once."""
        text = protocol.encode_words("event", name=name, **fields)
        for page in self.pages.values():
            page.tell(text)

    def now_ms(self) -> float:
        """Return the robot's clock in milliseconds, as the wire has it."""
        return self.clock.now_s() * 1000

    def publish_state(self) -> None:
        """Tell every page how things are now."""
        self._told = self._gist()
        self._told_s = self.clock.now_s()
        if not self.pages:
            return
        owner = self.lease.owner
        state = describe(self.robot.loop.state, self.now_ms())
        state["nonce"] = self.nonces.issue(self.robot.clock.now_s())
        state["pilot"] = owner
        state["viewers"] = len(self.pages) - (owner in self.pages)
        others = protocol.encode_words("state", you_are_pilot=False, **state)
        for page in self.pages.values():
            if not page.wants_state(self._told, self._told_s):
                continue
            if page.client == owner:
                page.tell_state(protocol.encode_words("state", you_are_pilot=True, **state))
            else:
                page.tell_state(others)

    def _gist(self) -> object:
        """What a page must hear of at once."""
        state = self.robot.loop.state
        decision = state.decision
        return (
            decision.mode,
            decision.driven_by,
            decision.stop_reason,
            decision.asks_pilot,
            state.link,
            state.emergency,
            state.fault,
            self.lease.owner,
        )

    # The beat ----------------------------------------------------------------------------------

    def _note_tick(self) -> None:
        """Take over what the control loop left: on the event loop, at most once per wake-up."""
        self._is_tick_due = False
        self._show_newest()
        if self.pages and (
            self.clock.now_s() - self._told_s >= STATE_EVERY_S or self._gist() != self._told
        ):
            self.publish_state()

    def _show_newest(self) -> None:
        if self._frame is not None and self._frame is not self.video.newest:
            self.video.show(self._frame, self.nonces.issue(self.robot.clock.now_s()))

    async def _keep_time(self) -> None:
        """Pass a lapsed wheel on, and go on telling even if the control loop were silent."""
        while True:
            await self.clock.pause(STATE_EVERY_S)
            if not self.pages:
                continue
            if self.lease.pass_on_if_lapsed(self.clock.now_s()):
                self._change_hands()
            if self.clock.now_s() - self._told_s >= STATE_EVERY_S:
                self.publish_state()
