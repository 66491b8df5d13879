"""How the board reaches a robot's server: requests, and websockets that stay open.

Every connection goes to the address that the handshake was bound to: a name is looked up once, and
over https the certificate seen first is the only one accepted after it.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import http.client
import json
import socket
import ssl
import threading
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar
from urllib.parse import urlsplit

from websockets.exceptions import WebSocketException

from robot.errors import ConfigurationError, RobotError
from server.board.class_key import endpoint

_T = TypeVar("_T")
LARGEST_BYTES = 64_000_000
"""The largest answer that is read: a model."""
_PATIENCE_S = 4.0
_FILE_PATIENCE_S = 60.0
_THREADS = 64


class UnreachableError(RobotError, OSError):
    """A robot does not answer, or ended in the middle of an answer."""


@dataclass(frozen=True, slots=True)
class RobotAddress:
    """Where a robot's server listens, as a person or the network named it."""

    host: str
    port: int
    is_tls: bool = False

    @classmethod
    def parse(cls, text: str) -> RobotAddress:
        """Read `HOST`, `HOST:PORT` or the address of the robot's page.

        Raises:
            ConfigurationError: If it is none of these.
        """
        whole = text.strip() if "://" in text else f"http://{text.strip()}"
        try:
            parts = urlsplit(whole)
            host, port = parts.hostname or "", parts.port
        except ValueError:
            host, port, parts = "", None, urlsplit("")
        if not host or parts.scheme not in ("http", "https") or parts.path not in ("", "/"):
            raise ConfigurationError(
                f"{text.strip()!r} is no robot's address; write HOST:PORT, or https://HOST:PORT"
            )
        return cls(host, port if port is not None else 8000, parts.scheme == "https")

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'https' if self.is_tls else 'http'}://{host}:{self.port}"


@dataclass(frozen=True, slots=True)
class ServerPlace:
    """A robot's server as the network has it now: where all connections go.

    Attributes:
        address: With a number in place of a name.
        endpoint: What both sides of a handshake must agree on.
        certificate: The only one accepted; None over http.
    """

    address: RobotAddress
    endpoint: str
    certificate: ssl.SSLContext | None = None


@dataclass(frozen=True, slots=True)
class HttpAnswer:
    """The answer to a request."""

    status: int
    body: bytes

    def json(self) -> dict[str, Any]:
        """Return the object in the body; {} if there is none."""
        try:
            value = json.loads(self.body)
        except (ValueError, RecursionError):
            return {}
        return value if isinstance(value, dict) else {}


class Channel(Protocol):
    """An open websocket. Methods raise UnreachableError when it has ended."""

    async def receive(self) -> str | bytes:
        """Return the next message."""
        ...

    async def send(self, message: str | bytes) -> None:
        """Send one message."""
        ...


class NetworkTransport:
    """Reaches robots over the network. Methods raise UnreachableError when one does not answer.

    Who has opened no session yet, as strangers have not, is asked by other threads than the class.
    """

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(_THREADS, thread_name_prefix="asks-robots")
        self._foyer = ThreadPoolExecutor(_THREADS, thread_name_prefix="asks-strangers")

    async def locate(self, address: RobotAddress) -> ServerPlace:
        """Return where a robot is now: look its name up, and over https its certificate."""
        return await self._in_thread(self._foyer, _locate, address)

    async def request(
        self,
        place: ServerPlace,
        method: str,
        path: str,
        headers: Mapping[str, str],
        body: bytes = b"",
    ) -> HttpAnswer:
        """Send one request on a connection of its own."""
        threads = self._threads if "authorization" in headers else self._foyer
        return await self._in_thread(threads, _request, place, method, path, dict(headers), body)

    @contextlib.asynccontextmanager
    async def connect(
        self, place: ServerPlace, path: str, headers: Mapping[str, str]
    ) -> AsyncIterator[Channel]:
        """Open a websocket for the length of the block."""
        url = str(place.address).replace("http", "ws", 1) + path
        options: dict[str, Any] = {"compression": None, "max_size": 1 << 20}
        options |= {"open_timeout": _PATIENCE_S, "close_timeout": 1.0, "ping_interval": None}
        if place.certificate is not None:
            options["ssl"] = place.certificate
        try:
            async with _open(url, dict(headers), options) as socket:
                yield _WebsocketChannel(socket)
        except (OSError, WebSocketException, EOFError) as error:
            raise UnreachableError(_describe(error)) from error

    async def _in_thread(
        self, threads: ThreadPoolExecutor, work: Callable[..., _T], *args: Any
    ) -> _T:
        try:
            return await asyncio.get_running_loop().run_in_executor(threads, work, *args)
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise UnreachableError(_describe(error)) from error


class _WebsocketChannel:
    def __init__(self, socket: Any) -> None:
        self._socket = socket

    async def receive(self) -> str | bytes:
        try:
            message: str | bytes = await self._socket.recv()
        except (OSError, WebSocketException) as error:
            raise UnreachableError(_describe(error)) from error
        return message

    async def send(self, message: str | bytes) -> None:
        try:
            await self._socket.send(message)
        except (OSError, WebSocketException) as error:
            raise UnreachableError(_describe(error)) from error


def _open(url: str, headers: dict[str, str], options: dict[str, Any]) -> Any:
    """Open a websocket with any version of the library."""
    try:
        from websockets.asyncio.client import connect
    except ImportError:
        import websockets  # before version 13

        return websockets.connect(url, extra_headers=headers, **options)
    return connect(url, additional_headers=headers, proxy=None, **options)


def _locate(address: RobotAddress) -> ServerPlace:
    found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)
    found.sort(key=lambda row: row[0] != socket.AF_INET)
    number = str(found[0][4][0])
    there = RobotAddress(number, address.port, address.is_tls)
    own = endpoint(number, address.port)
    if not address.is_tls:
        return ServerPlace(there, own)
    unchecked = ssl.create_default_context()
    unchecked.check_hostname, unchecked.verify_mode = False, ssl.CERT_NONE
    with _connected(there, unchecked, _PATIENCE_S) as wrapped:
        assert isinstance(wrapped, ssl.SSLSocket)
        der = wrapped.getpeercert(binary_form=True) or b""
    pinned = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    pinned.check_hostname = False  # the certificate itself is compared, whatever its names
    pinned.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    pinned.load_verify_locations(cadata=der)
    return ServerPlace(there, f"{own} {hashlib.sha256(der).hexdigest()}", pinned)


def _request(
    place: ServerPlace, method: str, path: str, headers: dict[str, str], body: bytes
) -> HttpAnswer:
    address = place.address
    is_file = path.endswith("/file")
    patience_s, most = (_FILE_PATIENCE_S, LARGEST_BYTES) if is_file else (_PATIENCE_S, 1 << 20)
    connection = http.client.HTTPConnection(address.host, address.port)
    with _connected(address, place.certificate, patience_s) as connection.sock:
        connection.request(method, path, body or None, headers)
        response = connection.getresponse()
        data = response.read(most + 1)
        if len(data) > most:
            raise UnreachableError("its answer is too large")
        return HttpAnswer(response.status, data)


@contextlib.contextmanager
def _connected(
    address: RobotAddress, certificate: ssl.SSLContext | None, patience_s: float
) -> Iterator[socket.socket]:
    """Connect for the length of the block, and no longer than so: who sends a byte now and then
    would otherwise keep a thread for ever."""
    line = socket.create_connection((address.host, address.port), patience_s)
    if certificate is not None:
        line = certificate.wrap_socket(
            line, server_hostname=address.host, do_handshake_on_connect=False
        )
    cut = threading.Timer(patience_s, socket.socket.shutdown, (line, socket.SHUT_RDWR))
    cut.daemon = True
    with line:
        cut.start()
        try:
            if isinstance(line, ssl.SSLSocket):
                line.do_handshake()
            yield line
        finally:
            cut.cancel()


def _describe(error: BaseException) -> str:
    if isinstance(error, UnreachableError):
        return str(error)
    if isinstance(error, TimeoutError):
        return "it does not answer in time"
    if isinstance(error, http.client.IncompleteRead):
        return "it ended in the middle of its answer"
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).lower()
