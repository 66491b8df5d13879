"""The clients of one robot: their connections, the pilot, and their messages.

Everything runs on the server's event loop. Only the gate in robot/ decides about motors.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
from collections import Counter
from concurrent.futures import Future

from robot.devices.rig import Rig
from robot.moves import describe, move_at
from robot.types import Mode, PilotCommand, StopReason
from server import protocol
from server.clients.broadcast import Broadcast
from server.clients.client import Client
from server.clients.emergency_stop import EmergencyStop
from server.clients.lease import Lease
from server.clients.rate_limit import RateLimit
from server.clients.telemetry import STATE_EVERY_S, describe_body, describe_devices
from server.config import Config
from server.gateway.roles import Role
from server.identity import IdentityFile
from server.protocol import BareMessage, ErrorCode, ProtocolError, encode_message

log = logging.getLogger(__name__)
_UNWATCHED_S = 0.5
"""Interval of the timer in seconds while no client is connected."""


class Hub:
    """Handles the messages of one robot's clients; one client at a time has the wheel.

    Attributes:
        broadcast: Sends the clients states, pictures and events.
        lease: The lease of control, by the ids of clients.
        emergency: The newest STOP.
        pilot: The last person who had the wheel and may come back.
        refused: The number of refused messages, by reason.
    """

    def __init__(self, config: Config, robot: Rig, identity: IdentityFile) -> None:
        self.identity = identity
        self._limits = config.limits
        self._clock, self._loop = robot.clock, robot.loop
        self._driver, self._camera = robot.driver, robot.camera
        self.lease, self.emergency = Lease(), EmergencyStop()
        self.broadcast = Broadcast(config, robot, self.lease, self.emergency)
        self.pilot = ""
        self.refused: Counter[ErrorCode] = Counter()
        self._asks = RateLimit(per_second=1.0, burst=3.0)
        self._ids = itertools.count(1)
        self._timer: asyncio.Task[None] | None = None

    async def start(self) -> None:
        self.broadcast.start()
        self._timer = asyncio.create_task(self._run_timer())

    async def stop(self) -> None:
        """Stop sending, and stop the robot if a client drove it."""
        self.broadcast.stop()
        self._loop.empty_command()
        if self._timer is not None:
            self._timer.cancel()
            await asyncio.gather(self._timer, return_exceptions=True)

    def join(self, role: Role, person: str = "") -> Client:
        """Add a client of a person; it gets the wheel if it may drive and the wheel is free."""
        now_s = self._clock.now_s()
        client = Client(f"c{next(self._ids)}", role, person, self._limits, self.refused)
        hello = encode_message(
            "hello",
            protocol=protocol.PROTOCOL_VERSION,
            client=client.id,
            role=role.value,
            robot=self.identity.now.name,
            moves=list(self._loop.state.moves),
            server_ms=now_s * 1000,
            **describe_body(self._driver),
            **describe_devices(self._driver, self._camera),
        )
        client.send(hello)
        self.broadcast.add(client)
        if role.may_drive and self.lease.join(client.id, now_s):
            self._pilot_changed()
        else:
            self.broadcast.publish_state()
        log.info("join client=%s role=%s pilot=%s", client.id, role.value, self.lease.owner)
        return client

    def leave(self, client: Client) -> None:
        """Remove a client that disconnected; if it had the wheel, the robot stops immediately."""
        self.broadcast.remove(client)
        now_s = self._clock.now_s()
        is_changed = self.lease.give_up(client.id, now_s)
        drivers = [one for one in self.broadcast.clients.values() if one.role.may_drive]
        # The only client left that may drive is usually the pilot's new connection.
        if self.lease.owner is None and len(drivers) == 1:
            is_changed = self.lease.join(drivers[0].id, now_s)
        if is_changed:
            self._pilot_changed()
        else:
            self.broadcast.publish_state()
        log.info("leave client=%s refused=%d", client.id, client.refusals.number)

    def receive(self, client: Client, text: str | bytes) -> None:
        """Handle one message of a client; refused messages are answered and counted."""
        now_s = self._clock.now_s()
        is_within = client.pace.allows(now_s) and not client.refusals.shut_out.is_set()
        try:
            if isinstance(text, bytes):
                raise ProtocolError(ErrorCode.MALFORMED, "a message must be text, not bytes")
            if not is_within and not protocol.is_stop(text):
                raise ProtocolError(ErrorCode.TOO_FAST, "too many messages a second")
            message = protocol.parse_message(
                text, self._loop.state.moves, takes_points=self._driver.takes_points
            )
            self._handle(client, message, now_s)
        except ProtocolError as error:
            client.refuse(error)

    def _handle(self, client: Client, message: protocol.ClientMessage, now_s: float) -> None:
        if isinstance(message, protocol.DriveMessage):
            self._handle_drive(client, message, now_s)
        elif isinstance(message, protocol.ModeMessage):
            self._handle_mode(client, message, now_s)
        elif isinstance(message, protocol.Ping):
            pong = {"client_ms": message.client_ms, "server_ms": now_s * 1000}
            client.send(encode_message("pong", **pong))
        elif message is BareMessage.STOP:
            client.is_answer_due = True  # answer even if the robot already stands still
            self.latch_emergency(client.id, client.role)
        elif isinstance(message, protocol.ReleaseMessage):
            self._release_emergency(client, message.stop_number)
        elif message is BareMessage.TAKE:
            self._handle_take(client, now_s)
        elif message in (BareMessage.IDLE, BareMessage.WATCH):
            client.is_idle = message is BareMessage.IDLE  # the next state is soon sent to all
            self.broadcast.note_need()
        elif self.lease.give_up(client.id, now_s):
            self._pilot_changed()

    def latch_emergency(self, source: str, role: Role) -> int:
        """Stop the robot for any client; return the number of this STOP."""
        self.emergency.press(role, self._clock.now_s())
        self._loop.latch_emergency()
        log.warning("emergency client=%s", source)
        return self.emergency.number

    def _release_emergency(self, client: Client, stop_number: int) -> None:
        """Allow modes to be chosen again; the robot stays stopped until a mode is chosen."""
        self.emergency.check_release(stop_number, client.role)
        if not client.role.holds_stop:
            self._require_wheel(client)
        self.emergency.held_by = None
        self._loop.release_emergency()
        log.info("release client=%s", client.id)

    def _handle_mode(self, client: Client, message: protocol.ModeMessage, now_s: float) -> None:
        client.require_newer(message.seq)
        self._require_wheel(client, message.seq)
        self.lease.renew(now_s)
        proven_s = self.broadcast.nonces.issued_s(message.nonce)
        if message.mode is not Mode.STOPPED:
            self._require_known_frame(message.frame, message.seq)
            if message.frame is None:
                raise self.broadcast.nonces.why_refused(None, message.seq)
            self.emergency.check_start(message.seq, proven_s, now_s)
        asked = self._loop.set_mode(message.mode, proven_s=proven_s, frame_id=message.frame)

        def note(asked: Future[bool]) -> None:  # runs on the control loop's thread
            is_refused = not asked.cancelled() and asked.exception() is None and not asked.result()
            if is_refused and not self._loop.state.emergency:
                error = self.broadcast.nonces.why_refused(message.frame, message.seq)
                self.broadcast.soon(client.refuse, error)

        asked.add_done_callback(note)
        log.info("mode client=%s mode=%s", client.id, message.mode.value)

    def _require_known_frame(self, frame: int | None, seq: int) -> None:
        if (frame or 0) > (self._loop.state.frame_id or 0):
            sentence = f"frame {frame} does not exist yet"
            raise ProtocolError(ErrorCode.UNKNOWN_FRAME, sentence, seq)

    def _handle_drive(self, client: Client, message: protocol.DriveMessage, now_s: float) -> None:
        client.require_newer(message.seq)
        self._require_wheel(client, message.seq)
        self._require_known_frame(message.frame, message.seq)
        self.lease.renew(now_s)
        held, point, loop = message.held, message.point, self._loop
        if point is not None:
            held = move_at(point, describe(loop.state.moves, self._driver.declared_moves))
        loop.command(
            PilotCommand(
                held=held,
                point=point if held else None,
                frame_id=message.frame,
                seq=message.seq,
                frame_age_s=message.frame_age_ms and message.frame_age_ms / 1000,
                phone_s=message.phone_ms and message.phone_ms / 1000,
                received_s=self._clock.now_s(),
                pilot=client.id,
                proven_s=self.broadcast.nonces.issued_s(message.nonce),
                seen_id=self.broadcast.video.drawn_by(client.person),
            )
        )

    def _handle_take(self, client: Client, now_s: float) -> None:
        if not client.role.may_drive:
            raise ProtocolError(ErrorCode.NOT_PILOT, "this browser may only watch")
        before = self.lease.owner
        if not self.lease.take(client.id, now_s):
            owner = self.broadcast.clients.get(before or "")
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
        self._loop.empty_command()
        if self.lease.owner is not None:
            self.pilot = self.broadcast.clients[self.lease.owner].person
        log.info("wheel pilot=%s", self.lease.owner)
        self.broadcast.publish_new_pilot()

    async def _run_timer(self) -> None:
        """Give a lapsed lease to the next client; publish the state even if the loop stalls."""
        while True:
            pause_s = STATE_EVERY_S if self.broadcast.clients else _UNWATCHED_S
            due_s = self._clock.now_s() + pause_s
            await self._clock.pause(pause_s)
            try:
                self._note_time(due_s)
            except Exception:  # without the timer, a silent pilot would keep the wheel
                self._loop.trip(StopReason.LOOP_FAULT)
                log.exception("the timer stopped the robot")

    def _note_time(self, due_s: float) -> None:
        now_s = self._clock.now_s()
        self._loop.note_lateness(now_s - due_s)
        if self.lease.pass_on_if_lapsed(now_s):
            self._pilot_changed()
        if now_s - self.broadcast.published_s >= STATE_EVERY_S:
            self.broadcast.publish_state()
