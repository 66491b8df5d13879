"""A robot of any kind that serves a websocket: docs/reference/robot-protocol.md."""

from __future__ import annotations

from typing import ClassVar

from robot.bodies.remote.driver import RemoteDriver
from robot.bodies.remote.line import MessageLine, WebsocketLine


class WsDriver(RemoteDriver):
    """The same messages as `udp`, as text of a websocket."""

    name: ClassVar[str] = "ws"

    def _open_address(self, host: str, port: int) -> MessageLine:
        return WebsocketLine(host, port)
