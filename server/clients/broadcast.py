"""Sends the clients of one robot its states, its pictures, events, and refusals of their messages.

The control loop's thread only hands over its newest tick (`_hear`); everything else runs on the
server's event loop.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence

from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.types import Decision, DrivenBy, Frame, Mode, PilotCommand
from server.clients.client import Client
from server.clients.emergency_stop import EmergencyStop
from server.clients.freshness import NonceLedger
from server.clients.lease import Lease
from server.clients.telemetry import SOON_S, STATE_EVERY_S, describe_state
from server.clients.video import Encoder, VideoHub
from server.config import Config
from server.protocol import encode_message

LASTING = ("set_aside", "nothing_kept", "check_battery", "unfit")
"""Events that are also sent to clients that join later."""
_ENDS = {"kept_again": "nothing_kept", "battery_bears": "check_battery", "model_loaded": "unfit"}
"""Maps an event to the lasting event that it ends."""


class Broadcast:
    """Sends messages to the clients of one robot. `clients` maps ids to connected clients.

    `lease` and `emergency` are only read here. `published_s` is the time of the newest state.
    """

    def __init__(self, config: Config, robot: Rig, lease: Lease, emergency: EmergencyStop) -> None:
        self._loop, self._clock = robot.loop, robot.clock
        self._lease, self._emergency = lease, emergency
        self.clients: dict[str, Client] = {}
        self.nonces = NonceLedger(robot.loop.config.gate.command_timeout_s)
        self.event_loop: asyncio.AbstractEventLoop | None = None
        self._needed_every_s, self._is_watched = 0.0, False
        encoder = Encoder(config.jpeg_quality)
        self.video = VideoHub(encoder, robot.clock, robot.for_the_eye, self.note_need)
        self._previous_pilots: Decision | None = None
        self._urgent_sent: object = None
        self.published_s = 0.0
        self._frame: Frame | None = None
        self._is_tick_due = False
        self._lasting: tuple[tuple[str, str], ...] = ()
        self._unsubscribe: Callable[[], None] = lambda: None

    def start(self) -> None:
        self.event_loop = asyncio.get_running_loop()
        self._unsubscribe = self._loop.subscribe(self._hear)
        self.note_need()

    def stop(self) -> None:
        self._unsubscribe()
        self.event_loop = None
        self._loop.need_picture_every(0.0)

    def add(self, client: Client) -> None:
        """Add a client, and send it the events that still apply (`LASTING`)."""
        self.clients[client.id] = client
        self.note_need()
        for _, text in self._lasting:
            client.send(text)

    def remove(self, client: Client) -> None:
        self.clients.pop(client.id, None)
        self.note_need()

    def _hear(self, tick: Tick) -> None:
        """Note one tick; runs on the control loop's thread."""
        if tick.frame:
            self._frame = tick.frame
        if tick.refused:
            self.soon(self._tell_refused, tick.refused)
        is_wanted = (tick.frame and self._is_watched) or (self.clients and self._is_due(tick))
        if is_wanted and not self._is_tick_due:
            self._is_tick_due = True
            self.soon(self._note_tick)

    def _note_tick(self) -> None:
        """Publish the newest tick at most once per wake-up: first the state, then the picture."""
        self._is_tick_due = False
        try:
            if self._is_due(self._loop.state):
                self.publish_state()
        finally:
            asyncio.get_running_loop().call_soon(self.show_newest)

    def _is_due(self, state: Tick) -> bool:
        """True if the state is due: something urgent changed, or the interval has passed."""
        since_s = self._clock.now_s() - self.published_s
        is_slow = state.camera.period_s > SOON_S and state.decision.mode is not Mode.STOPPED
        every_s = SOON_S if is_slow else STATE_EVERY_S
        return since_s >= every_s or self._urgent(state) != self._urgent_sent

    def _urgent(self, state: Tick) -> object:
        """Return the fields, such as the pilot, whose changes are published immediately."""
        decision = state.decision
        is_pilots = decision.driven_by is DrivenBy.PILOT
        return (
            decision.action if is_pilots else None,  # a program waits for the result of its command
            *(decision.mode, decision.driven_by, decision.stop_reason, decision.asks_pilot),
            *(state.link.level, state.emergency, state.fault, state.is_resting),
            *(self._emergency.held_by, self._emergency.number),
        )

    def publish_new_pilot(self) -> None:
        """Publish the state. It says that nobody drives, until the loop has decided again."""
        self._previous_pilots = self._loop.state.decision
        self.publish_state()

    def publish_state(self) -> None:
        now_s, owner, newest = self._clock.now_s(), self._lease.owner, self._loop.state
        self._urgent_sent, self.published_s = self._urgent(newest), now_s
        if not self.clients:
            return
        held_by = self._emergency.held_by
        state = {
            **describe_state(newest, now_s * 1000),
            "nonce": self.nonces.issue(now_s),
            "pilot": owner,
            "wheel_asked": self._lease.is_asked,
            "stop_held_by": held_by and held_by.value,
            "stop_number": self._emergency.number,
            "viewers": len(self.clients) - (owner in self.clients),
        }
        if newest.decision is self._previous_pilots and state["driven_by"] is DrivenBy.PILOT:
            state["driven_by"] = DrivenBy.NOBODY
        texts: dict[bool, str] = {}  # each text is encoded once for all clients
        for client in self.clients.values():
            if client.is_state_due((self._urgent_sent, owner), now_s):
                is_pilot = client.id == owner
                if is_pilot not in texts:
                    texts[is_pilot] = encode_message("state", you_are_pilot=is_pilot, **state)
                client.send_state(texts[is_pilot])

    def show_newest(self) -> None:
        """Pass the newest frame to the video."""
        if self._frame is not None and self._frame is not self.video.newest:
            self.video.show(self._frame, self.nonces.issue(self._clock.now_s()))

    def note_need(self) -> None:
        """Tell the loop the rate at which clients need pictures, if the rate has changed."""
        self._is_watched = self.video.viewers > 0
        is_shown = any(not client.is_idle for client in self.clients.values())
        every_s = 0.0 if is_shown else self.video.needed_every_s
        if every_s != self._needed_every_s and self.event_loop is not None:
            self._needed_every_s = every_s
            if self._loop.state.is_resting:  # the last frame is old
                self._frame = self.video.newest = None
            self._loop.need_picture_every(every_s)

    def announce(self, name: str, **fields: object) -> None:
        """Send an event to all clients; an event of `LASTING` also goes to clients that join later.

        May be called on any thread, and before the start; never blocks.
        """
        text = encode_message("event", name=name, **fields)
        if name in LASTING:
            self._lasting = (*self._lasting, (name, text))
        elif name in _ENDS:
            self._lasting = tuple(one for one in self._lasting if one[0] != _ENDS[name])
        self.soon(self._send_to_all, text)

    def _send_to_all(self, text: str) -> None:
        for client in self.clients.values():
            client.send(text)

    def _tell_refused(self, refused: Sequence[PilotCommand]) -> None:
        """Tell clients which commands the gate refused, and why."""
        for command in refused:
            if client := self.clients.get(command.pilot):
                client.refuse(self.nonces.why_refused(command.frame_id, command.seq))

    def soon(self, call: Callable[..., None], *args: object) -> None:
        """Schedule a call on the event loop; may be called on any thread."""
        with contextlib.suppress(RuntimeError):  # the server's event loop has just ended
            if self.event_loop is not None:
                self.event_loop.call_soon_threadsafe(call, *args)
