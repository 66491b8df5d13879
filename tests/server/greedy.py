"""A paired program that uses as many connections and requests as it can, in a separate process; for
test_stop_always."""

from __future__ import annotations

import asyncio
import contextlib
import sys

SOCKETS, IDLE = 62, 510
_KEY = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
_PING = b'{"type":"ping","client_ms":1}'
_BURST = 700 * (bytes([0x81, 0x80 | len(_PING), 0, 0, 0, 0]) + _PING)
"""A burst of messages, masked with zeros so that a person can read them in a dump."""


class Greedy:
    """A client that opens every kind of connection at once, again and again."""

    def __init__(self, port: int, cookie: str) -> None:
        self._port, self._cookie = port, cookie

    async def _connect(self, path: str, more: str = "") -> tuple[asyncio.StreamReader, ...]:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        head = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: {self._cookie}\r\n{more}\r\n"
        writer.write(head.encode())
        return reader, writer  # type: ignore[return-value]

    async def hold(self, path: str, more: str = "", burst: bytes = b"") -> None:
        """Hold one connection for as long as the server allows, and then open the next."""
        while True:
            with contextlib.suppress(OSError, EOFError):
                reader, writer = await self._connect(path, more)
                writer.write(burst)  # type: ignore[attr-defined]
                while await reader.read(65_536):
                    pass
                writer.close()  # type: ignore[attr-defined]
            await asyncio.sleep(2.0)

    async def run(self) -> None:
        """Hold all connections until cancelled."""
        upgrade = f"Upgrade: websocket\r\nConnection: Upgrade\r\n{_KEY}"
        async with asyncio.TaskGroup() as all_at_once:
            for number in range(SOCKETS):
                burst = _BURST if number % 8 == 0 else b""
                all_at_once.create_task(self.hold("/ws/drive", upgrade, burst))
            for _ in range(IDLE):
                all_at_once.create_task(self.hold("/healthz"))


if __name__ == "__main__":
    import resource  # not on Windows

    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    asyncio.run(Greedy(int(sys.argv[1]), sys.argv[2]).run())
