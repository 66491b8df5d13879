"""The clients of one robot: their connections, the pilot, and the published states.

Everything runs on the server's event loop; the control loop's thread only hands over its newest
tick. Only the gate in robot/ decides about motors, not this module.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import math
import secrets
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Future

from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.driver import describe, move_at
from robot.types import Decision, DrivenBy, Frame, Mode, PilotCommand, StopReason
from server import protocol
from server.clients.client import Client
from server.clients.freshness import NonceLedger, why_refused
from server.clients.lease import Lease
from server.clients.rate_limit import RateLimit
from server.clients.telemetry import (
    SOON_S,
    STATE_EVERY_S,
    describe_body,
    describe_devices,
    describe_state,
)
from server.clients.video import Encoder, VideoHub
from server.config import Config
from server.gateway.roles import Role
from server.protocol import BareMessage, ErrorCode, ProtocolError, encode_message

log = logging.getLogger(__name__)
_RECENT_S = 2.0
"""For this time after a STOP, in seconds, a start must prove that it was sent after the STOP. Pages
repeat an unproven start for one second, so a start that comes later was sent after the STOP."""
_FIRST_STOP = 2**31
"""A server's first STOP has a random number below this, so that no old message names it by
chance."""
_UNWATCHED_S = 0.5
"""Interval of the timer in seconds while no client is connected."""
LASTING = ("set_aside", "nothing_kept", "check_battery")
"""Events that are also sent to clients that join later."""
_ENDS = {"kept_again": "nothing_kept", "battery_bears": "check_battery"}
"""Events that end a lasting event: each with the event that it ends."""


class Hub:
    """The server's side of one robot."""

    def __init__(self, config: Config, robot: Rig, name: str) -> None:
        self.config = config
        self.robot = robot
        self.clock = robot.clock
        self.name = name
        self._needed_every_s, self._is_watched = 0.0, False
        self.video = VideoHub(
            Encoder(config.jpeg_quality), robot.clock, robot.camera.for_the_eye, self._note_need
        )
        self.lease = Lease()
        self._asks = RateLimit(per_second=1.0, burst=3.0)
        self.nonces = NonceLedger()
        self.stop_held_by: Role | None = None
        """The role that stopped the robot, if only that role may release it."""
        self.stop_number = 1 + secrets.randbelow(_FIRST_STOP)
        """The number of the newest STOP; each STOP adds one, even while another is latched."""
        self._stopped_s = -math.inf
        self.refused: Counter[ErrorCode] = Counter()
        self.clients: dict[str, Client] = {}
        self._limit_s = robot.loop.config.gate.command_timeout_s
        self.pilot = ""  # the last person to have the wheel, who may come back
        self._previous_pilots: Decision | None = None
        self._ids = itertools.count(1)
        self._sent: object = None
        self._sent_s = 0.0
        self._frame: Frame | None = None
        self._is_tick_due = False
        self._lasting: tuple[tuple[str, str], ...] = ()
        self.event_loop: asyncio.AbstractEventLoop | None = None
        self._unsubscribe: Callable[[], None] = lambda: None
        self._timer: asyncio.Task[None] | None = None

    async def start(self) -> None:
        self.event_loop = asyncio.get_running_loop()

        def on_tick(tick: Tick) -> None:  # runs on the control loop's thread
            self._frame = tick.frame or self._frame
            if tick.refused:
                self._soon(self._tell_refused, tick.refused)
            is_wanted = (tick.frame and self._is_watched) or (self.clients and self._is_due())
            if is_wanted and not self._is_tick_due:
                self._is_tick_due = True
                self._soon(self._note_tick)

        self._unsubscribe = self.robot.loop.subscribe(on_tick)
        self._timer = asyncio.create_task(self._run_timer())
        self._note_need()

    async def stop(self) -> None:
        """Unsubscribe, and stop the robot if a client drove it."""
        self._unsubscribe()
        self.event_loop = None
        self.robot.loop.need_picture_every(0.0)
        self.robot.loop.empty_command()
        if self._timer is not None:
            self._timer.cancel()
            await asyncio.gather(self._timer, return_exceptions=True)

    def _soon(self, call: Callable[..., None], *args: object) -> None:
        """Schedule a call on the event loop; may be called on any thread."""
        with contextlib.suppress(RuntimeError):  # the server's event loop has just ended
            if self.event_loop is not None:
                self.event_loop.call_soon_threadsafe(call, *args)

    def join(self, role: Role, person: str = "") -> Client:
        """Add a client of a person; it gets the wheel if it may drive and the wheel is free."""
        now_s = self.clock.now_s()
        client = Client(f"c{next(self._ids)}", role, self.config.limits, now_s, person)
        self.clients[client.id] = client
        self._note_need()
        client.send(
            encode_message(
                "hello",
                protocol=protocol.PROTOCOL_VERSION,
                client=client.id,
                role=role.value,
                robot=self.name,
                moves=list(self.robot.loop.state.moves),
                server_ms=self.now_ms(),
                **describe_body(self.robot.driver),
                **describe_devices(self.robot.driver, self.robot.camera),
            )
        )
        for _, text in self._lasting:
            client.send(text)
        if role.may_drive and self.lease.join(client.id, now_s):
            self._pilot_changed()
        else:
            self.publish_state()
        log.info("join client=%s role=%s pilot=%s", client.id, role.value, self.lease.owner)
        return client

    def leave(self, client: Client) -> None:
        """Remove a client that disconnected; if it had the wheel, the robot stops immediately."""
        self.clients.pop(client.id, None)
        self._note_need()
        now_s = self.clock.now_s()
        if self.lease.give_up(client.id, now_s):
            drivers = [one for one in self.clients.values() if one.role.may_drive]
            # The remaining driver is usually the pilot, who reconnected.
            if self.lease.owner is None and len(drivers) == 1:
                self.lease.join(drivers[0].id, now_s)
            self._pilot_changed()
        else:
            self.publish_state()
        log.info("leave client=%s refused=%d", client.id, client.refused)

    def receive(self, client: Client, text: str | bytes) -> None:
        """Handle one message of a client; refused messages are answered and counted."""
        now_s = self.clock.now_s()
        is_within = client.pace.allows(now_s) and not client.shut_out.is_set()
        try:
            if isinstance(text, bytes):
                raise ProtocolError(ErrorCode.MALFORMED, "messages are text, not bytes")
            if not is_within and not protocol.is_stop(text):
                raise ProtocolError(ErrorCode.TOO_FAST, "too many messages a second")
            message = protocol.parse_message(
                text, self.robot.loop.state.moves, takes_points=self.robot.driver.takes_points
            )
            self._handle(client, message, now_s)
        except ProtocolError as error:
            self.refuse(client, error)

    def refuse(self, client: Client, error: ProtocolError) -> None:
        self.refused[error.code] += 1
        client.refuse(error)

    def _handle(self, client: Client, message: protocol.ClientMessage, now_s: float) -> None:
        if isinstance(message, protocol.DriveMessage):
            self._handle_drive(client, message, now_s)
        elif isinstance(message, protocol.ModeMessage):
            self._handle_mode(client, message, now_s)
        elif isinstance(message, protocol.Ping):
            client.send(
                encode_message("pong", client_ms=message.client_ms, server_ms=self.now_ms())
            )
        elif message is BareMessage.STOP:
            client.is_answer_due = True  # answer even if the robot stands still already
            self.latch_emergency(client.id, client.role)
        elif isinstance(message, protocol.ReleaseMessage):
            self._release_emergency(client, message.stop_number)
        elif message is BareMessage.TAKE:
            self._handle_take(client, now_s)
        elif message in (BareMessage.IDLE, BareMessage.WATCH):
            client.is_idle = message is BareMessage.IDLE  # the next state is soon sent to all
            self._note_need()
        elif self.lease.give_up(client.id, now_s):
            self._pilot_changed()

    def latch_emergency(self, source: str, role: Role) -> int:
        """Stop the robot for any client; a role may reserve the release for itself.

        Return the number of this STOP.
        """
        if role.holds_stop:
            self.stop_held_by = role
        self.stop_number += 1
        self._stopped_s = self.clock.now_s()
        self.robot.loop.latch_emergency()
        log.warning("emergency client=%s", source)
        return self.stop_number

    def _release_emergency(self, client: Client, stop_number: int) -> None:
        """Allow modes to be chosen again; the robot stays stopped until a mode is chosen.

        A release may be late, so it only counts for the STOP that its sender has seen.
        """
        if stop_number != self.stop_number:
            sentence = "STOP was pressed again after this release; look, then release STOP again"
            raise ProtocolError(ErrorCode.NEWER_STOP, sentence)
        holder = self.stop_held_by
        if holder is not None and client.role is not holder:
            raise ProtocolError(ErrorCode.STOP_HELD, f"only the {holder.value} may release STOP")
        if not client.role.holds_stop:
            self._require_wheel(client)
        self.stop_held_by = None
        self.robot.loop.release_emergency()
        log.info("release client=%s", client.id)

    def _handle_mode(self, client: Client, message: protocol.ModeMessage, now_s: float) -> None:
        client.require_newer(message.seq)
        self._require_wheel(client, message.seq)
        self.lease.renew(now_s)
        if message.mode is not Mode.STOPPED:
            self._require_known_frame(message.frame, message.seq)
            if message.frame is None:
                raise why_refused(None, message.seq, self._limit_s)
        proven_s = self.nonces.issued_s(message.nonce)
        if message.mode is not Mode.STOPPED and proven_s < self._stopped_s >= now_s - _RECENT_S:
            sentence = "STOP was pressed after this choice; look, then choose the mode again"
            raise ProtocolError(ErrorCode.NEWER_STOP, sentence, message.seq)
        asked = self.robot.loop.set_mode(message.mode, proven_s=proven_s, frame_id=message.frame)

        def note(asked: Future[bool]) -> None:  # runs on the control loop's thread
            is_refused = not asked.cancelled() and asked.exception() is None and not asked.result()
            if is_refused and not self.robot.loop.state.emergency:
                error = why_refused(message.frame, message.seq, self._limit_s)
                self._soon(self.refuse, client, error)

        asked.add_done_callback(note)
        log.info("mode client=%s mode=%s", client.id, message.mode.value)

    def _require_known_frame(self, frame: int | None, seq: int) -> None:
        if (frame or 0) > (self.robot.loop.state.frame_id or 0):
            sentence = f"frame {frame} does not exist yet"
            raise ProtocolError(ErrorCode.UNKNOWN_FRAME, sentence, seq)

    def _handle_drive(self, client: Client, message: protocol.DriveMessage, now_s: float) -> None:
        client.require_newer(message.seq)
        self._require_wheel(client, message.seq)
        self._require_known_frame(message.frame, message.seq)
        self.lease.renew(now_s)
        held, point, loop = message.held, message.point, self.robot.loop
        if point is not None:
            held = move_at(point, describe(loop.state.moves, self.robot.driver.declared_moves))
        loop.command(
            PilotCommand(
                held=held,
                point=point if held else None,
                frame_id=message.frame,
                seq=message.seq,
                frame_age_s=message.frame_age_ms and message.frame_age_ms / 1000,
                phone_s=message.phone_ms and message.phone_ms / 1000,
                received_s=self.clock.now_s(),
                pilot=client.id,
                proven_s=self.nonces.issued_s(message.nonce),
                seen_id=self.video.drawn_by(client.person),
            )
        )

    def _handle_take(self, client: Client, now_s: float) -> None:
        if not client.role.may_drive:
            raise ProtocolError(ErrorCode.NOT_PILOT, "this browser may only watch")
        before = self.lease.owner
        if not self.lease.take(client.id, now_s):
            owner = self.clients.get(before or "")
            if owner and self._asks.allows(now_s):  # the limit applies to all clients together
                owner.send(encode_message("event", name="wheel_asked", client=client.id))
            client.send(encode_message("event", name="wheel_waiting", pilot=before))
        elif before != client.id:
            self._pilot_changed()

    def _require_wheel(self, client: Client, seq: int | None = None) -> None:
        if self.lease.owner != client.id:
            raise ProtocolError(ErrorCode.NOT_PILOT, "another client has the wheel", seq)

    def _pilot_changed(self) -> None:
        """Drop the last command, because the wheel has a new owner or no owner."""
        self.robot.loop.empty_command()
        self._previous_pilots = self.robot.loop.state.decision
        if self.lease.owner is not None:
            self.pilot = self.clients[self.lease.owner].person
        log.info("wheel pilot=%s", self.lease.owner)
        self.publish_state()

    def _note_need(self) -> None:
        """Tell the loop the rate at which clients need pictures, if the rate has changed."""
        self._is_watched = self.video.viewers > 0
        is_shown = any(not client.is_idle for client in self.clients.values())
        every_s = 0.0 if is_shown else self.video.needed_every_s
        if every_s != self._needed_every_s and self.event_loop is not None:
            self._needed_every_s = every_s
            self.robot.loop.need_picture_every(every_s)

    def announce(self, name: str, **fields: object) -> None:
        """Send an event to all clients; an event of `LASTING` also goes to clients that join later.

        May be called on any thread, and before the start; never blocks.
        """
        text = encode_message("event", name=name, **fields)
        if name in LASTING:
            self._lasting = (*self._lasting, (name, text))
        elif name in _ENDS:
            self._lasting = tuple(one for one in self._lasting if one[0] != _ENDS[name])
        self._soon(self._send_to_all, text)

    def _send_to_all(self, text: str) -> None:
        for client in self.clients.values():
            client.send(text)

    def now_ms(self) -> float:
        return self.clock.now_s() * 1000

    def publish_state(self) -> None:
        self._sent, self._sent_s = self._urgent(), self.clock.now_s()
        if not self.clients:
            return
        owner = self.lease.owner
        loop = self.robot.loop
        state = {
            **describe_state(loop.state, self.now_ms(), is_resting=loop.is_resting),
            "nonce": self.nonces.issue(self._sent_s),
            "pilot": owner,
            "wheel_asked": self.lease.is_asked,
            "stop_held_by": self.stop_held_by and self.stop_held_by.value,
            "stop_number": self.stop_number,
            "viewers": len(self.clients) - (owner in self.clients),
        }
        if loop.state.decision is self._previous_pilots and state["driven_by"] is DrivenBy.PILOT:
            state["driven_by"] = DrivenBy.NOBODY  # the new pilot has not driven yet
        texts: dict[bool, str] = {}  # each text is encoded once for all clients
        for client in self.clients.values():
            if client.is_state_due((self._sent, owner), self._sent_s):
                is_pilot = client.id == owner
                if is_pilot not in texts:
                    texts[is_pilot] = encode_message("state", you_are_pilot=is_pilot, **state)
                client.send_state(texts[is_pilot])

    def _urgent(self) -> object:
        """Return the part of the state whose changes are published at once, such as the pilot."""
        state = self.robot.loop.state
        decision = state.decision
        is_pilots = decision.driven_by is DrivenBy.PILOT
        return (
            decision.action if is_pilots else None,  # a program waits for its command's result
            *(decision.mode, decision.driven_by, decision.stop_reason, decision.asks_pilot),
            *(state.link.level, state.emergency, state.fault),
            self.stop_held_by,
            self.stop_number,
        )

    def _tell_refused(self, refused: Sequence[PilotCommand]) -> None:
        """Tell clients which commands the gate refused, and why."""
        for command in refused:
            if client := self.clients.get(command.pilot):
                self.refuse(client, why_refused(command.frame_id, command.seq, self._limit_s))

    def _note_tick(self) -> None:
        """Publish the newest tick at most once per wake-up: first the state, then the picture."""
        self._is_tick_due = False
        try:
            if self._is_due():
                self.publish_state()
        finally:
            asyncio.get_running_loop().call_soon(self.show_newest)

    def _is_due(self) -> bool:
        """True if the state is due: something urgent changed, or the interval has passed."""
        state, since_s = self.robot.loop.state, self.clock.now_s() - self._sent_s
        is_slow = state.camera.period_s > SOON_S and state.decision.mode is not Mode.STOPPED
        return since_s >= (SOON_S if is_slow else STATE_EVERY_S) or self._urgent() != self._sent

    def show_newest(self) -> None:
        """Pass the newest frame to the video, unless nobody watches."""
        is_old = self.robot.loop.is_resting and not self.video.viewers
        if self._frame is not None and self._frame is not self.video.newest and not is_old:
            self.video.show(self._frame, self.nonces.issue(self.clock.now_s()))

    async def _run_timer(self) -> None:
        """Pass on a lapsed lease, and publish the state even if the control loop stalls."""
        while True:
            pause_s = STATE_EVERY_S if self.clients else _UNWATCHED_S
            due_s = self.clock.now_s() + pause_s
            await self.clock.pause(pause_s)
            try:
                self._note_time(due_s)
            except Exception:  # without a timer a silent pilot would never lose the wheel
                self.robot.loop.trip(StopReason.LOOP_FAULT)
                log.exception("the timer stopped the robot")

    def _note_time(self, due_s: float) -> None:
        now_s = self.clock.now_s()
        self.robot.loop.note_lateness(now_s - due_s)
        if self.lease.pass_on_if_lapsed(now_s):
            self._pilot_changed()
        if now_s - self._sent_s >= STATE_EVERY_S:
            self.publish_state()
