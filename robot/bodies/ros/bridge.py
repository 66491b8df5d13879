"""A client of rosbridge: ROS topics as JSON over a websocket, on a separate thread.

The protocol is described at github.com/RobotWebTools/rosbridge_suite (ROSBRIDGE_PROTOCOL.md).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable, Mapping
from typing import Any

import websockets

from robot.bodies.remote.orders import split_address
from robot.bodies.remote.reconnecting import ReconnectingConnection
from robot.bodies.ros.refusals import REFUSED_S, Refusals, Unwrapping
from robot.bodies.ros.topics import End, Message, OnMessage, Topics
from robot.clock import Clock
from robot.errors import DriveError, told_as

PORT = 9090
CONNECT_S = 4.0
SEND_S = 0.3
PING_EVERY_S = 0.1
MAX_BYTES = 6 * 2**20
_LOST_S = 3.0
"""Time limit for the answer to a ping, in seconds. If the answer comes later or not at all, the
connection is opened again."""
_ASK_AGAIN_S = REFUSED_S / 2
"""Time after which refused topics are requested again, in seconds, because the node that caused the
refusal may have ended. If that node still runs, rosbridge refuses the topics again before the
earlier refusal expires (`REFUSED_S`)."""


class RosBridge(ReconnectingConnection, Topics):
    """Connects, stays connected, and passes on the topics' messages.

    Args:
        address: The address of rosbridge, HOST or HOST:PORT.

    Raises:
        DriveError: If nothing answers at the address.
    """

    def __init__(
        self,
        address: str,
        clock: Clock,
        *,
        advertised: Mapping[str, str],
        subscribed: Mapping[str, str],
        on_message: OnMessage,
    ) -> None:
        host, port = split_address(address, PORT)
        self.where = f"rosbridge at {address}"
        self._url = f"ws://{host}:{port}/"
        self._advertised, self._subscribed = advertised, subscribed
        self._on_message = on_message
        self._socket: Any = None
        self._heard_s = clock.now_s()
        self._ends: dict[str, asyncio.TimerHandle] = {}
        self._refusals, self._asking_again = Refusals(), False
        do = "is it running? ros2 launch rosbridge_server rosbridge_websocket_launch.xml"
        with told_as(DriveError, f"no rosbridge can be reached at {host}:{port}", do=do):
            super().__init__("rosbridge", clock)

    @property
    def silent_s(self) -> float:
        return self._clock.now_s() - self._heard_s

    @property
    def refusal(self) -> str:
        return self._refusals.at(self._clock.now_s())

    def refused(self, refusal: str) -> str:
        return f"{self.where} refuses: {refusal}"

    def publish(self, topic: str, message: Message, ends: End | None = None) -> None:
        self._send_one(self._publish(topic, message, ends), topic).result(SEND_S)

    def publish_soon(self, topic: str, message: Message) -> None:
        with contextlib.suppress(ConnectionError):
            self._send_one(self._publish(topic, message, None), topic)

    # On the thread -----------------------------------------------------------------------------

    async def _connect_once(self, connected: Callable[[], None]) -> None:
        async with websockets.connect(
            self._url,
            compression=None,
            max_size=MAX_BYTES,
            ping_interval=None,
            open_timeout=CONNECT_S,
            close_timeout=SEND_S,
        ) as socket:
            await self._ask(socket)
            unwrapping = Unwrapping()
            self._socket, self._heard_s = socket, self._clock.now_s()
            connected()
            pinging = asyncio.ensure_future(self._ping(socket))
            try:
                async for data in socket:
                    self._heard_s = self._clock.now_s()
                    for message in unwrapping.messages(data):
                        self._take(socket, message)
            finally:
                pinging.cancel()
                self._socket = None
                for handle in self._ends.values():
                    handle.cancel()
                self._ends.clear()
        self.trouble = "rosbridge has closed the connection"

    async def _ping(self, socket: Any) -> None:
        """Send pings, and close a connection that has not answered for too long."""
        with contextlib.suppress(TimeoutError):
            while True:
                async with asyncio.timeout(_LOST_S):
                    await (await socket.ping())
                self._heard_s, self.trouble = self._clock.now_s(), ""
                await self._clock.pause(PING_EVERY_S)
        await socket.close()

    async def _ask(self, socket: Any) -> None:
        """Advertise and subscribe. A later status message about a topic contains this `id`."""
        for topic, kind in self._advertised.items():
            await _send(socket, op="advertise", id=f"advertise:{topic}", topic=topic, type=kind)
        for topic, kind in self._subscribed.items():
            name = f"subscribe:{topic}"
            # Queue at most one message, because only the newest message counts.
            await _send(socket, op="subscribe", id=name, topic=topic, type=kind, queue_length=1)

    def _take(self, socket: Any, told: Message) -> None:
        if told.get("op") == "status":
            if self._refusals.take(told, self._heard_s) and not self._asking_again:
                self._asking_again = True
                asyncio.ensure_future(self._ask_again(socket)).add_done_callback(_let_fail)
        elif told.get("op") == "publish":
            topic, message = str(told.get("topic")), told.get("msg")
            if topic in self._subscribed and isinstance(message, dict):
                self._on_message(topic, message)

    async def _ask_again(self, socket: Any) -> None:
        try:
            await self._clock.pause(_ASK_AGAIN_S)
            await self._ask(socket)
        finally:
            self._asking_again = False

    async def _publish(self, topic: str, message: Message, ends: End | None) -> None:
        socket = self._socket
        if (handle := self._ends.pop(topic, None)) is not None:
            handle.cancel()
        if socket is None:
            raise ConnectionError("not connected")
        if ends is not None:
            end, for_s = ends
            loop = asyncio.get_running_loop()
            self._ends[topic] = loop.call_later(for_s, self._end, topic, end)
        await _send(socket, op="publish", id=f"publish:{topic}", topic=topic, msg=message)

    def _end(self, topic: str, end: Message) -> None:
        self._ends.pop(topic, None)
        task = asyncio.ensure_future(self._publish(topic, end, None))
        task.add_done_callback(_let_fail)


def _let_fail(task: asyncio.Future[None]) -> None:
    """Retrieve a finished task's error, because asyncio logs an error that nobody retrieves."""
    if not task.cancelled():
        task.exception()


async def _send(socket: Any, **fields: Any) -> None:
    await socket.send(json.dumps(fields, separators=(",", ":")))
