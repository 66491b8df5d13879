"""A proxy between page and robot that can drop the link without closing it."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from typing import Any
from urllib.parse import urlsplit


class Proxy:
    """Between page and robot; can fall silent without closing anything."""

    def __init__(self, address: str) -> None:
        self._to = urlsplit(address)
        self._loop = asyncio.new_event_loop()
        self._open = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        self.address = ""
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self._ready.wait(5)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(asyncio.start_server(self._serve, "127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        self._open.set()
        self._ready.set()
        self._loop.run_forever()
        server.close()
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(asyncio.sleep(0.05))
        self._loop.close()

    async def _serve(self, reader: Any, writer: Any) -> None:
        up = await asyncio.open_connection(self._to.hostname, self._to.port)
        both = (self._pump(reader, up[1]), self._pump(up[0], writer))
        with contextlib.suppress(OSError, asyncio.CancelledError):
            await asyncio.gather(*both)

    async def _pump(self, reader: Any, writer: Any) -> None:
        with contextlib.suppress(OSError, asyncio.CancelledError):
            while data := await reader.read(65536):
                await self._open.wait()
                writer.write(data)
                await writer.drain()
        writer.close()

    def fall_silent(self) -> None:
        self._loop.call_soon_threadsafe(self._open.clear)

    def speak_again(self) -> None:
        self._loop.call_soon_threadsafe(self._open.set)

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)
