"""Requests and websockets to a virtual server, for tests that are not coroutines."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Self

import httpx
from websockets.exceptions import ConnectionClosedError, ConnectionClosedOK, InvalidStatus
from websockets.frames import Close

from .virtual import Socket, asgi_scope

if TYPE_CHECKING:
    from .virtual_server import VirtualServer


class Exchange:
    """One HTTP request and its answer so far."""

    def __init__(self, server: VirtualServer, request: httpx.Request, raw_path: str | None) -> None:
        self.status: int | None = None
        self.headers: list[tuple[bytes, bytes]] = []
        self.chunks: list[bytes] = []
        self.is_over = False
        self._incoming: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        chunks = list(request.stream)
        for number, chunk in enumerate(chunks or [b""]):
            more = number < len(chunks) - 1
            self._incoming.put_nowait({"type": "http.request", "body": chunk, "more_body": more})
        path = request.url.raw_path.decode("ascii") if raw_path is None else raw_path
        headers = [(name.lower(), value) for name, value in request.headers.raw]
        more = {"method": request.method, "server": ("127.0.0.1", server.port)}
        scope = asgi_scope("http", request.url.scheme, path, headers, **more)
        self.task = asyncio.ensure_future(server.app(scope, self._incoming.get, self._send))

    async def _send(self, message: dict[str, Any]) -> None:
        if message["type"] == "http.response.start":
            self.status, self.headers = message["status"], list(message.get("headers", []))
        else:
            self.chunks.append(message.get("body", b""))
            self.is_over = not message.get("more_body", False)

    def hang_up(self) -> None:
        self._incoming.put_nowait({"type": "http.disconnect"})


class Body(httpx.SyncByteStream):
    def __init__(self, server: VirtualServer, exchange: Exchange) -> None:
        self._server, self._exchange = server, exchange

    def __iter__(self) -> Iterator[bytes]:
        exchange = self._exchange
        while True:
            while exchange.chunks:
                yield exchange.chunks.pop(0)
            if exchange.is_over or exchange.task.done():
                return
            self._server.wait_until(
                lambda: bool(exchange.chunks) or exchange.is_over or exchange.task.done(), 60.0
            )

    def close(self) -> None:
        self._exchange.hang_up()
        if not self._exchange.is_over:
            with contextlib.suppress(Exception):
                self._server.run(asyncio.wait_for(self._exchange.task, 1.0))
        else:
            self._server.wait_until(self._exchange.task.done, 60.0)


class VirtualSocket:
    """A websocket with the interface of the library `websockets`, to a virtual server."""

    def __init__(self, server: VirtualServer, path: str, headers: dict[str, str]) -> None:
        self._server = server
        self._messages: list[str | bytes] = []

        async def begin() -> Socket:
            return server.connect(path, self._messages.append, headers)

        self._socket = server.run(begin())
        server.wait_until(lambda: self._socket.is_accepted or self._socket.is_closed)
        if self._socket.refused_with is not None:
            raise InvalidStatus(_Refused(self._socket.refused_with))

    @property
    def close_code(self) -> int | None:
        return self._socket.close_code

    def send(self, message: str | bytes) -> None:
        self._check_open()
        self._socket.send(message)
        self._server.forward(0)

    def recv(self, timeout: float | None = 60.0) -> str | bytes:
        try:
            self._server.wait_until(
                lambda: bool(self._messages) or self._socket.is_closed, timeout or 60.0
            )
        except AssertionError as error:
            raise TimeoutError(str(error)) from error
        if self._messages:
            return self._messages.pop(0)
        self._check_open()
        raise AssertionError("unreachable")

    def close(self) -> None:
        if not self._socket.is_closed:
            self._socket.close()
            self._server.wait_until(self._socket.task.done)

    def _check_open(self) -> None:
        code = self._socket.close_code
        if self._socket.is_closed:
            kind = ConnectionClosedOK if code in (1000, 1001) else ConnectionClosedError
            raise kind(Close(code or 1006, ""), None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class _Refused:
    def __init__(self, status_code: int) -> None:
        self.status_code = status_code
