"""A robot of any kind, by datagrams: docs/reference/robot-protocol.md."""

from __future__ import annotations

from typing import ClassVar

from robot.bodies.remote.driver import RemoteDriver
from robot.bodies.remote.line import MessageLine, UdpLine


class UdpDriver(RemoteDriver):
    """An ESP32, a Pico W, or whatever else answers on a UDP port."""

    name: ClassVar[str] = "udp"

    def _open_address(self, host: str, port: int) -> MessageLine:
        return UdpLine(host, port)
