"""A robot of any kind, by datagrams: docs/reference/robot-protocol.md."""

from __future__ import annotations

import contextlib
import socket
from typing import ClassVar

from robot.bodies.remote.driver import RemoteDriver


class UdpLine:
    """Datagrams to and from one address; see `MessageLine`."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.connect((host, port))
        except OSError:
            self._socket.close()
            raise

    def send(self, message: bytes) -> None:
        self._socket.send(message)

    def receive(self, timeout_s: float) -> bytes | None:
        self._socket.settimeout(max(timeout_s, 0.001))
        with contextlib.suppress(TimeoutError):
            return self._socket.recv(2048)
        return None

    def close(self) -> None:
        self._socket.close()


class UdpDriver(RemoteDriver):
    """An ESP32, a Pico W, or any other robot that answers on a UDP port."""

    name: ClassVar[str] = "udp"
    line_type = UdpLine
