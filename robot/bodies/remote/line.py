"""A line to a robot: one message there, one back."""

from __future__ import annotations

import contextlib
import queue
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

from robot.bodies.remote.event_loop import EventLoopThread
from robot.clock import Clock, RealClock
from robot.errors import ConfigurationError, need

_OPENS_S, _OPENS_AGAIN_S, _SENDS_S = 4.0, 1.0, 0.5
_MOST_WAITING = 20
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


class KeptLine(ABC):
    """A line whose connection a thread of its own keeps, and opens again when it was lost.

    What was being sent then is not sent again: what comes later is no order any more.

    Raises:
        OSError: If the first connection fails.
    """

    def __init__(self, name: str, clock: Clock) -> None:
        self._received: queue.Queue[bytes] = queue.Queue(_MOST_WAITING)
        self._worker = EventLoopThread(name, clock)
        self._worker.keep(self._connect_once)

    @abstractmethod
    async def _connect_once(self, connected: Callable[[], None]) -> None:
        """Connect, call `connected`, and return when the connection is lost."""

    def _take_message(self, message: bytes) -> None:
        if self._received.full():
            with contextlib.suppress(queue.Empty):
                self._received.get_nowait()  # nobody reads: the newest counts
        self._received.put_nowait(message)

    def receive(self, timeout_s: float) -> bytes | None:
        try:
            if timeout_s > 0:
                return self._received.get(timeout=timeout_s)
            return self._received.get_nowait()
        except queue.Empty:
            return None

    def close(self) -> None:
        self._worker.close()


class WebsocketLine(KeptLine):
    """A websocket that the robot serves; one on which nothing is heard any more is opened anew."""

    def __init__(self, host: str, port: int) -> None:
        self._connect = need("websockets", "the robot 'ws'", "demo").connect
        self._url = f"ws://{host}:{port}/"
        self._socket: Any = None
        self._opens_s = _OPENS_S
        super().__init__("websocket", RealClock())

    async def _connect_once(self, connected: Callable[[], None]) -> None:
        async with self._connect(
            self._url,
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
        self._worker.trouble = "the connection was lost"

    def send(self, message: bytes) -> None:
        socket = self._socket
        if socket is None:
            raise ConnectionError(self._worker.trouble)
        self._unanswered += 1
        if self._unanswered > _MOST_UNANSWERED:
            self._worker.submit(socket.close())
        self._worker.run(socket.send(message.decode()), _SENDS_S)


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
