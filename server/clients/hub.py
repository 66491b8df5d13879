"""The clients of one robot: their connections, the pilot, and their messages.

Everything runs on the server's event loop. Only the gate in robot/ decides about motors, not this
module.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import math
from collections.abc import Callable
from concurrent.futures import Future

from robot.devices.rig import Rig
from robot.driver import describe, move_at
from robot.types import Mode, PilotCommand, StopReason
from server import protocol
from server.clients.broadcast import Broadcast
from server.clients.client import Client
from server.clients.freshness import why_refused
from server.clients.rate_limit import RateLimit
from server.clients.telemetry import STATE_EVERY_S, describe_body, describe_devices
from server.config import Config
from server.gateway.roles import Role
from server.protocol import BareMessage, ErrorCode, ProtocolError, encode_message

log = logging.getLogger(__name__)
_RECENT_S = 2.0
"""For this time after a STOP, in seconds, a start must prove that it was sent after the STOP. Pages
repeat a start for one second only, so after this time no start from before the STOP comes."""
_UNWATCHED_S = 0.5
"""Interval of the timer in seconds while no client is connected."""


class Hub(Broadcast):
    """The server's side of one robot."""

    def __init__(self, config: Config, robot: Rig, name: str) -> None:
        super().__init__(config, robot)
        self.name = name
        self.pilot = ""  # the last person to have the wheel, who may come back
        self._asks = RateLimit(per_second=1.0, burst=3.0)
        self._stopped_s = -math.inf
        self._ids = itertools.count(1)
        self._unsubscribe: Callable[[], None] = lambda: None
        self._timer: asyncio.Task[None] | None = None

    async def start(self) -> None:
        self.event_loop = asyncio.get_running_loop()
        self._unsubscribe = self.robot.loop.subscribe(self._hear)
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
