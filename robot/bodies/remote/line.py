"""A line to a robot: one message there, one back."""

from __future__ import annotations

import contextlib
import socket
from typing import Any, Protocol

from robot.bodies.remote.event_loop import EventLoopThread
from robot.clock import RealClock
from robot.errors import ConfigurationError, need

_OPENS_S, _OPENS_AGAIN_S, _SENDS_S = 4.0, 1.0, 0.5
_MOST_UNANSWERED = 10
"""After so many messages without an answer, a second and a half, the connection is a dead one."""


class MessageLine(Protocol):
    """Messages as bytes. Methods raise OSError when the line fails."""

    def send(self, message: bytes) -> None:
        """Send one message."""

    def receive(self, timeout_s: float) -> bytes | None:
        """Return the next message, or None after `timeout_s`."""

    def close(self) -> None:
        """Let go; idempotent."""


class UdpLine:
    """Datagrams to and from one address."""

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


class WebsocketLine:
    """A websocket that the robot serves.

    A connection that fails, or on which nothing is heard any more, is closed, and the next message
    opens another. What was being sent is not sent again: what comes later is no order any more.
    """

    def __init__(self, host: str, port: int) -> None:
        self._connect = need("websockets", "the robot 'ws'", "demo").connect
        self._worker = EventLoopThread("websocket", RealClock())
        self._run = self._worker.run
        self._address = host, port
        self._socket: Any = None
        self._unanswered = 0
        try:
            self._socket = self._run(self._open(*self._address), _OPENS_S)
        except BaseException:
            self._worker.close()
            raise

    async def _open(self, host: str, port: int) -> Any:
        return await self._connect(
            f"ws://{host}:{port}/", compression=None, max_size=2048, close_timeout=_SENDS_S
        )

    def send(self, message: bytes) -> None:
        if self._unanswered >= _MOST_UNANSWERED:
            self._drop()
        if self._socket is None:
            self._socket = self._run(self._open(*self._address), _OPENS_AGAIN_S)
        try:
            self._run(self._socket.send(message.decode()), _SENDS_S)
        except OSError:
            self._drop()
            raise
        self._unanswered += 1

    def receive(self, timeout_s: float) -> bytes | None:
        if self._socket is None:
            raise ConnectionError("the connection was lost")
        try:
            # With no time at all not even a message that is there already would be taken.
            message = self._run(self._socket.recv(), max(timeout_s, 0.001))
        except TimeoutError:
            return None
        except OSError:
            self._drop()
            raise
        self._unanswered = 0
        return message.encode() if isinstance(message, str) else bytes(message)

    def close(self) -> None:
        self._drop()
        self._worker.close()

    def _drop(self) -> None:
        socket, self._socket, self._unanswered = self._socket, None, 0
        if socket is not None:
            with contextlib.suppress(OSError):
                self._run(socket.close(), 1.0)


def split_address(address: str, default_port: int) -> tuple[str, int]:
    """Return host and port of HOST or HOST:PORT.

    Raises:
        ConfigurationError: If it is neither.
    """
    host, _, port = address.strip().rpartition(":") if ":" in address else (address.strip(), "", "")
    number = port or str(default_port)
    if not host or "/" in host or not number.isdecimal() or not 0 < int(number) < 65536:
        raise ConfigurationError(
            f"--address must be the robot's HOST or HOST:PORT, not {address!r}"
        )
    return host, int(number)
