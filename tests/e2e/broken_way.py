"""The network between a phone and a robot in a school: real sockets, one fault at a time."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
from typing import Any

from tests.kit.loops import LoopThread, stop_accepting

_PORTAL = b"<!doctype html><title>Sign in</title><p>Welcome to the network. Please sign in."


def _answer(status: str, body: bytes = b"", kind: str = "text/html", more: str = "") -> bytes:
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n{more}"
    return f"{head}Connection: close\r\n\r\n".encode() + body


ANSWERS = {
    "captive portal, 200": _answer("200 OK", _PORTAL),
    "captive portal, 302": _answer("302 Found", more="Location: /login\r\n"),
    "captive portal, 401": _answer("401 Unauthorized", _PORTAL),
    "wrong port": _answer("404 Not Found", b'{"error": "no such page"}', "application/json"),
    "gateway": _answer("502 Bad Gateway", b"upstream is gone", "text/plain"),
}
"""The answer to every request, from anybody."""


class BrokenWay:
    """A path to a server on another port, broken in the manner of `fault`.

    `silent` passes on nothing, without closing anything: what was sent comes when it is healed.

    Args:
        port: Of the server on this machine.
        as_proxy: It is a forward proxy, which browsers ask for `http://...` and CONNECT.
        inspecting: The certificate of a box that looks into TLS, for `TLS inspected`.
    """

    def __init__(
        self, port: int, *, as_proxy: bool = False, inspecting: ssl.SSLContext | None = None
    ) -> None:
        self.upstream, self.as_proxy, self.inspecting = port, as_proxy, inspecting
        self.cut_s = 5.0
        self._fault = ""
        self._writers: set[Any] = set()
        self._transports: list[Any] = []
        self._calls: set[asyncio.Task[None]] = set()
        self._full: list[socket.socket] = []
        self._loop = LoopThread()
        self.port = 0
        self._server: Any = None
        self._loop.do(self._listen())

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def fault(self) -> str:
        return self._fault

    @fault.setter
    def fault(self, fault: str) -> None:
        """Break it, or restore it with the empty text; open connections are affected, too."""
        self._loop.do(self._become(fault))

    async def _listen(self) -> None:
        is_inspected = self._fault == "TLS inspected"
        self._server = await asyncio.start_server(
            self._accept,
            "127.0.0.1",
            self.port,
            ssl=self.inspecting if is_inspected else None,
            reuse_address=True,
        )
        self.port = self._server.sockets[0].getsockname()[1]

    async def _become(self, fault: str) -> None:
        before, self._fault = self._fault, fault
        if "silent" in (before, fault):
            return
        await self._stop_listening()
        for one in self._full:
            one.close()
        self._full = []
        if fault == "no route":  # packets vanish without a notice, and new connections are dropped
            await self._fill_up()
            return
        for writer in list(self._writers):
            writer.transport.abort()
        if fault != "refused":
            await self._listen()

    async def _stop_listening(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            await stop_accepting(server)
            server.close()

    async def _fill_up(self) -> None:
        """Listen with a full queue, so that Linux drops all further connections."""
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", self.port))
        listener.listen(0)
        self._full = [listener]
        for _ in range(2):
            caller = socket.socket()
            caller.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                caller.connect(("127.0.0.1", self.port))
            self._full.append(caller)

    def _accept(self, reader: Any, writer: Any) -> None:
        self._transports.append(writer.transport)
        self._calls.add(call := asyncio.create_task(self._serve(reader, writer)))
        call.add_done_callback(self._calls.discard)

    async def _serve(self, reader: Any, writer: Any) -> None:
        self._writers.add(writer)
        try:
            await self._talk(reader, writer)
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # the other side closed the connection
        except asyncio.CancelledError:
            pass  # the path has ended
        finally:
            self._writers.discard(writer)
            writer.transport.abort() if self._fault == "refused" else writer.close()

    async def _talk(self, reader: Any, writer: Any) -> None:
        if (answer := ANSWERS.get(self._fault)) is not None:
            await reader.readuntil(b"\r\n\r\n")
            writer.write(answer)
            await writer.drain()
            return
        if self._fault == "asleep":
            await asyncio.sleep(3600)
        head = b""
        if self.as_proxy or self._fault in ("websockets blocked", "websockets cut"):
            head = await reader.readuntil(b"\r\n\r\n")
        is_connect = head.startswith(b"CONNECT ")
        is_live = is_connect or b"upgrade: websocket" in head.lower()
        if is_live and self._fault in ("CONNECT refused", "websockets blocked"):
            writer.write(_answer("403 Forbidden", b"blocked by policy"))
            await writer.drain()
            return
        try:
            up = await asyncio.open_connection("127.0.0.1", self.upstream)
        except OSError:
            if self.as_proxy:
                writer.write(ANSWERS["gateway"])
                await writer.drain()
            return
        self._writers.add(up[1])
        self._transports.append(up[1].transport)
        if is_connect:
            writer.write(b"HTTP/1.1 200 Connection established\r\n\r\n")
        elif head:
            # Each connection has one request, because the next one may have to be blocked.
            lines = head.decode("latin-1").split("\r\n")
            kept = [line for line in lines if not line.lower().startswith("connection:")]
            if self.as_proxy:
                method, target, version = kept[0].split(" ", 2)
                kept[0] = f"{method} /{target.split('/', 3)[3]} {version}"
            kept.insert(1, f"Connection: {'Upgrade' if is_live else 'close'}")
            up[1].write("\r\n".join(kept).encode("latin-1"))
        limit_s = self.cut_s if is_live and self._fault == "websockets cut" else None
        both = asyncio.gather(self._pump(reader, up[1]), self._pump(up[0], writer))
        try:
            await asyncio.wait_for(both, limit_s)
        except TimeoutError:
            writer.transport.abort()
        finally:
            self._writers.discard(up[1])
            up[1].transport.abort()

    async def _pump(self, reader: Any, writer: Any) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(65536):
                while self._fault in ("no route", "silent"):
                    await asyncio.sleep(0.05)
                writer.write(data)
                await writer.drain()
        writer.close()

    async def _end(self) -> None:
        self._fault = ""
        await self._become("refused")
        while others := asyncio.all_tasks() - {asyncio.current_task()}:
            for transport in self._transports:
                transport.abort()
            for call in self._calls:
                call.cancel()
            await asyncio.wait(others, timeout=0.05)
        for transport in self._transports:
            transport.abort()
        await asyncio.sleep(0)  # aborted connections are closed in the loop's next turn

    def close(self) -> None:
        self._loop.do(self._end())
        self._loop.close()
