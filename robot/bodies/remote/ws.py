"""A robot of any kind that serves a websocket: docs/reference/robot-protocol.md."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import websockets

from robot.bodies.remote.driver import PORT, MessageLine, RemoteDriver, the_only_one
from robot.bodies.remote.orders import split_address
from robot.bodies.remote.reconnecting import ReconnectingLink
from robot.clock import RealClock

_OPENS_S, _OPENS_AGAIN_S, _SENDS_S = 4.0, 1.0, 0.5
_MOST_UNANSWERED = 10
"""Maximum number of unanswered messages. If there are more, after about 1.5 s of silence, the
connection is closed and a new one is opened."""


class WebsocketLine(ReconnectingLink):
    """A websocket that the robot serves. If the robot falls silent, a new connection is opened."""

    def __init__(self, host: str, port: int, find: Callable[[], str] | None = None) -> None:
        """Open the first connection; `find` returns the host to which each connection goes."""
        self._find, self._port = find or (lambda: host), port
        self._socket: Any = None
        self._opens_s = _OPENS_S
        super().__init__("websocket", RealClock())

    async def _connect_once(self, connected: Callable[[], None]) -> None:
        async with websockets.connect(
            f"ws://{self._find()}:{self._port}/",
            compression=None,
            max_size=2048,
            open_timeout=self._opens_s,
            close_timeout=_SENDS_S,
        ) as socket:
            self._socket, self._unanswered, self._opens_s = socket, 0, _OPENS_AGAIN_S
            connected()
            try:
                async for message in socket:
                    self._unanswered = 0
                    self._take_message(message.encode() if isinstance(message, str) else message)
            finally:
                self._socket = None
        self.trouble = "the connection was lost"

    def send(self, message: bytes) -> None:
        socket = self._socket
        if socket is None:
            raise ConnectionError(self.trouble)
        self._unanswered += 1
        if self._unanswered > _MOST_UNANSWERED:
            self._submit(socket.close())
        self._send_one(socket.send(message.decode())).result(_SENDS_S)


class WsDriver(RemoteDriver):
    """Sends the messages of the driver `udp` as text over a websocket."""

    name: ClassVar[str] = "ws"
    line_type = WebsocketLine

    def _open_line(self) -> MessageLine:
        """Open the websocket. After a lost connection, the address is looked up again only if the
        robot's reports contain its unique name. Without a name, a new address could belong to
        another robot."""
        host, port = split_address(self.options.address, PORT)
        first = the_only_one(host)
        return WebsocketLine(first, port, lambda: the_only_one(host) if self._device else first)
