"""Sends the clients of one robot its states, its pictures, events, and refusals of their messages.

The control loop's thread only hands over its newest tick (`_hear`); everything else runs on the
server's event loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections import Counter
from collections.abc import Callable, Sequence

from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.types import Decision, DrivenBy, Frame, Mode, PilotCommand
from server.clients.client import Client
from server.clients.freshness import NonceLedger, why_refused
from server.clients.lease import Lease
from server.clients.telemetry import SOON_S, STATE_EVERY_S, describe_state
from server.clients.video import Encoder, VideoHub
from server.config import Config
from server.gateway.roles import Role
from server.protocol import ErrorCode, ProtocolError, encode_message

_FIRST_STOP = 2**31
"""A server's first STOP has a random number below this, so that no old message names it by
chance."""
LASTING = ("set_aside", "nothing_kept", "check_battery")
"""Events that are also sent to clients that join later."""
_ENDS = {"kept_again": "nothing_kept", "battery_bears": "check_battery"}
"""Events that end a lasting event: each with the event that it ends."""


class Broadcast:
    """Sends messages to the clients of one robot. `clients` has the connected clients by id."""

    def __init__(self, config: Config, robot: Rig) -> None:
        self.config = config
        self.robot = robot
        self.clock = robot.clock
        self.clients: dict[str, Client] = {}
        self.lease = Lease()
        self.nonces = NonceLedger()
        self.refused: Counter[ErrorCode] = Counter()
        self.stop_held_by: Role | None = None
        """The role that stopped the robot, if only that role may release it."""
        self.stop_number = 1 + secrets.randbelow(_FIRST_STOP)
        """The number of the newest STOP; each STOP adds one, even while another is latched."""
        self.event_loop: asyncio.AbstractEventLoop | None = None
        self._needed_every_s, self._is_watched = 0.0, False
        self.video = VideoHub(
            Encoder(config.jpeg_quality), robot.clock, robot.camera.for_the_eye, self._note_need
        )
        self._limit_s = robot.loop.config.gate.command_timeout_s
        self._previous_pilots: Decision | None = None
        self._sent: object = None
        self._sent_s = 0.0
        self._frame: Frame | None = None
        self._is_tick_due = False
        self._lasting: tuple[tuple[str, str], ...] = ()

    def _hear(self, tick: Tick) -> None:
        """Note one tick; runs on the control loop's thread."""
        self._frame = tick.frame or self._frame
        if tick.refused:
            self._soon(self._tell_refused, tick.refused)
        is_wanted = (tick.frame and self._is_watched) or (self.clients and self._is_due())
        if is_wanted and not self._is_tick_due:
            self._is_tick_due = True
            self._soon(self._note_tick)

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

    def show_newest(self) -> None:
        """Pass the newest frame to the video, unless nobody watches."""
        is_old = self.robot.loop.is_resting and not self.video.viewers
        if self._frame is not None and self._frame is not self.video.newest and not is_old:
            self.video.show(self._frame, self.nonces.issue(self.clock.now_s()))

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

    def _tell_refused(self, refused: Sequence[PilotCommand]) -> None:
        """Tell clients which commands the gate refused, and why."""
        for command in refused:
            if client := self.clients.get(command.pilot):
                self.refuse(client, why_refused(command.frame_id, command.seq, self._limit_s))

    def refuse(self, client: Client, error: ProtocolError) -> None:
        self.refused[error.code] += 1
        client.refuse(error)

    def now_ms(self) -> float:
        return self.clock.now_s() * 1000

    def _soon(self, call: Callable[..., None], *args: object) -> None:
        """Schedule a call on the event loop; may be called on any thread."""
        with contextlib.suppress(RuntimeError):  # the server's event loop has just ended
            if self.event_loop is not None:
                self.event_loop.call_soon_threadsafe(call, *args)
