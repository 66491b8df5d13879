"""Connects the board to a robot's server by requests and by websockets that stay open.

A robot's name is resolved once for each session, and all connections go to the resulting IP
address. Over https, all later connections accept only the certificate of the first one.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import http.client
import io
import os
import socket
import ssl
from collections.abc import AsyncIterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

from websockets.exceptions import WebSocketException

from robot.errors import ConfigurationError, RobotError, reason
from server.board.class_key import endpoint
from server.protocol import ProtocolError, parse_object

HERE = "127.0.0.1"
"""The address of a robot on the board's computer. No change of network breaks this connection."""
LARGEST_BYTES = 64_000_000
"""Maximum size of an answer in bytes; the largest answers are models."""
_PATIENCE_S = 4.0
_FILE_PATIENCE_S = 60.0
_THREADS = 64
_ENDS = (OSError, EOFError, UnicodeError, WebSocketException, http.client.HTTPException)


class UnreachableError(RobotError, OSError):
    """A robot does not answer, or its answer broke off."""


@dataclass(frozen=True, slots=True)
class RobotAddress:
    """The address of a robot's server, as a person typed it or the network announced it."""

    host: str
    port: int
    is_tls: bool = False

    @classmethod
    def parse(cls, text: str) -> RobotAddress:
        """Read `HOST`, `HOST:PORT` or the address of the robot's page."""
        whole = text.strip() if "://" in text else f"http://{text.strip()}"
        with contextlib.suppress(ValueError):
            parts = urlsplit(whole)
            port = 8000 if parts.port is None else parts.port
            if parts.hostname and parts.scheme in ("http", "https") and parts.path in ("", "/"):
                return cls(parts.hostname, port, parts.scheme == "https")
        raise ConfigurationError(
            f"{text.strip()!r} is not a robot's address; write HOST:PORT, or https://HOST:PORT"
        )

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'https' if self.is_tls else 'http'}://{host}:{self.port}"


@dataclass(frozen=True, slots=True)
class ServerPlace:
    """The current network address of a robot's server, to which all connections go.

    Attributes:
        address: The address, with an IP address instead of a name.
        endpoint: The text that both sides of a handshake must agree on.
        certificate: The only certificate that is accepted; None over http.
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
        """Return the JSON object in the body; {} if there is none."""
        with contextlib.suppress(ProtocolError):
            return parse_object(self.body.decode("utf-8", "replace"))
        return {}


class NetworkTransport:
    """Reaches robots over the network.

    Methods raise UnreachableError if a robot does not answer.
    """

    def __init__(self) -> None:
        self._looking_up = ThreadPoolExecutor(_THREADS, thread_name_prefix="looks-up-robots")

    async def locate(self, address: RobotAddress) -> ServerPlace:
        """Resolve a robot's address, and over https get its certificate."""
        async with within(_PATIENCE_S):
            found = await asyncio.get_running_loop().run_in_executor(
                self._looking_up, _look_up, address.host, address.port
            )
            there = RobotAddress(found, address.port, address.is_tls)
            own = endpoint(found, address.port)
            if not address.is_tls:
                return ServerPlace(there, own)
            unchecked = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            unchecked.check_hostname, unchecked.verify_mode = False, ssl.CERT_NONE
            async with _connected(there, unchecked) as (_, writer):
                der = writer.get_extra_info("ssl_object").getpeercert(binary_form=True)
            pinned = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            pinned.check_hostname = False  # the whole certificate is compared below
            pinned.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
            pinned.load_verify_locations(cadata=der)
            return ServerPlace(there, f"{own} {hashlib.sha256(der).hexdigest()}", pinned)

    async def request(
        self,
        place: ServerPlace,
        method: str,
        path: str,
        headers: Mapping[str, str],
        body: bytes = b"",
    ) -> HttpAnswer:
        """Send one request on a separate connection."""
        address, is_file = place.address, path.endswith("/file")
        patience_s, most = (_FILE_PATIENCE_S, LARGEST_BYTES) if is_file else (_PATIENCE_S, 1 << 20)
        own = {"host": str(address).partition("://")[2], "content-length": str(len(body))}
        lines = [f"{name}: {text}\r\n" for name, text in {**own, **headers}.items()]
        head = f"{method} {path} HTTP/1.1\r\nconnection: close\r\n{''.join(lines)}\r\n"
        data = bytearray()
        async with within(patience_s):
            async with _connected(address, place.certificate) as (reader, writer):
                writer.write(head.encode("utf-8", "replace") + body)
                await writer.drain()
                while part := await reader.read(1 << 16):
                    data += part
                    if len(data) > most:
                        raise UnreachableError("the robot's answer is too large")
            whole: Any = SimpleNamespace(makefile=lambda _: io.BytesIO(data))
            response = http.client.HTTPResponse(whole, method=method)
            response.begin()
            return HttpAnswer(response.status, response.read())

    @contextlib.asynccontextmanager
    async def connect(
        self, place: ServerPlace, path: str, headers: Mapping[str, str]
    ) -> AsyncIterator[Any]:
        """Open a websocket for the `with` block. If the connection fails, the block ends with
        UnreachableError."""
        url = str(place.address).replace("http", "ws", 1) + path
        options: dict[str, Any] = {"compression": None, "max_size": 1 << 20}
        options |= {"open_timeout": _PATIENCE_S, "close_timeout": 1.0, "ping_interval": None}
        if place.certificate is not None:
            options["ssl"] = place.certificate
        async with within(None), _open(url, dict(headers), options) as socket:
            yield socket


def _open(url: str, headers: dict[str, str], options: dict[str, Any]) -> Any:
    """Open a websocket with any version of `websockets`."""
    try:
        from websockets.asyncio.client import connect
    except ImportError:
        import websockets  # the client of websockets before version 13

        return websockets.connect(url, extra_headers=headers, **options)
    return connect(url, additional_headers=headers, proxy=None, **options)


def _look_up(host: str, port: int) -> str:
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return str(min(found, key=lambda row: row[0] != socket.AF_INET)[4][0])


@contextlib.asynccontextmanager
async def _connected(
    address: RobotAddress, certificate: ssl.SSLContext | None
) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
    """Open a connection for the `with` block. When the block ends, the connection is closed at
    once, and unread data is lost."""
    reader, writer = await asyncio.open_connection(address.host, address.port, ssl=certificate)
    try:
        yield reader, writer
    finally:
        writer.transport.abort()


@contextlib.asynccontextmanager
async def within(patience_s: float | None = 5.0) -> AsyncIterator[None]:
    """Turn a timeout and any connection error into an UnreachableError that names the cause."""
    try:
        async with asyncio.timeout(patience_s):
            yield
    except UnreachableError:
        raise
    except TimeoutError as error:
        raise UnreachableError("the robot does not answer in time") from error
    except http.client.IncompleteRead as error:
        raise UnreachableError("the robot's answer is incomplete") from error
    except _ENDS as error:
        number = getattr(error, "errno", None) or 0
        words = reason(error)
        if number > 0 and not isinstance(error, ssl.SSLError):
            words = os.strerror(number)  # the text of asyncio's error lacks the cause
        raise UnreachableError(words.lower()) from error
