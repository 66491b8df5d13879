"""The network between a phone and a robot in a school: real sockets, one fault at a time."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from tests.kit.loops import LoopThread


def _answer(status: str, body: bytes) -> bytes:
    head = f"HTTP/1.1 {status}\r\nContent-Type: text/plain\r\nContent-Length: {len(body)}\r\n"
    return f"{head}Connection: close\r\n\r\n".encode() + body


class BrokenWay:
    """A path to a server on another port of this machine, which a `fault` can break.

    - `silent`: it forwards nothing and closes no connection; after it is restored, all that was
        sent arrives.
    - `websockets blocked`: it answers every websocket with 403.
    - `gateway`: it answers every request with 502, as if the server were gone.
    """

    def __init__(self, port: int) -> None:
        self._upstream = port
        self._fault = ""
        self._writers: set[Any] = set()
        self._calls: set[asyncio.Task[None]] = set()
        self._loop = LoopThread()
        port = self._loop.serve(lambda: asyncio.start_server(self._accept, "127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{port}"

    @property
    def fault(self) -> str:
        return self._fault

    @fault.setter
    def fault(self, fault: str) -> None:
        """Break the path by a fault, or restore it if the text is empty; the fault also affects
        open connections."""
        self._loop.do(self._become(fault))

    async def _become(self, fault: str) -> None:
        before, self._fault = self._fault, fault
        if "silent" not in (before, fault):
            for writer in list(self._writers):
                writer.transport.abort()

    def _accept(self, reader: Any, writer: Any) -> None:
        self._calls.add(call := asyncio.create_task(self._serve(reader, writer)))
        call.add_done_callback(self._calls.discard)

    async def _serve(self, reader: Any, writer: Any) -> None:
        # Either side may close the connection.
        with contextlib.suppress(OSError, asyncio.IncompleteReadError):
            async with self._open(writer):
                await self._talk(reader, writer)

    @contextlib.asynccontextmanager
    async def _open(self, writer: Any) -> Any:
        """Register a connection, so that a fault can cut it, and close it at the end of the
        block."""
        self._writers.add(writer)
        try:
            yield
        finally:
            self._writers.discard(writer)
            writer.close()

    async def _talk(self, reader: Any, writer: Any) -> None:
        head = b""
        if self._fault in ("websockets blocked", "gateway"):
            head = await reader.readuntil(b"\r\n\r\n")
        is_live = b"upgrade: websocket" in head.lower()
        refusal = b""
        if self._fault == "gateway":
            refusal = _answer("502 Bad Gateway", b"upstream is gone")
        elif is_live:
            refusal = _answer("403 Forbidden", b"blocked by policy")
        if refusal:
            writer.write(refusal)
            await writer.drain()
            return
        up_reader, up_writer = await asyncio.open_connection("127.0.0.1", self._upstream)
        async with self._open(up_writer):
            # Each connection carries one request, because the next request may have to be blocked.
            lines = [
                one for one in head.split(b"\r\n") if not one.lower().startswith(b"connection")
            ]
            up_writer.write(
                b"\r\n".join([*lines[:1], b"Connection: close", *lines[1:]]) * bool(head)
            )
            await asyncio.gather(self._pump(reader, up_writer), self._pump(up_reader, writer))

    async def _pump(self, reader: Any, writer: Any) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(65536):
                while self._fault == "silent":
                    await asyncio.sleep(0.05)
                writer.write(data)
                await writer.drain()
        writer.close()

    async def _end(self) -> None:
        for writer in self._writers:
            writer.transport.abort()
        for call in self._calls:
            call.cancel()
        await asyncio.gather(*self._calls, return_exceptions=True)
        await asyncio.sleep(0)  # aborted connections are closed in the loop's next turn

    def close(self) -> None:
        self._loop.do(self._end())
        self._loop.close()
