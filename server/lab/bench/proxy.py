"""A bad link between page and robot: a TCP proxy that delays, jitters, throttles, or goes silent.

TCP hides loss and disorder from those who speak over it: what they see of either is that the line
stands still and then delivers all at once. So `drop` and `reorder` are made of such pauses.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import socket

from robot.testing.link import LinkConditions

_CHUNK_BYTES = 1460


class Proxy:
    """Listens on a free port and passes all on to the server, through the weather."""

    def __init__(self, port: int, conditions: LinkConditions | None = None) -> None:
        self.conditions = conditions or LinkConditions()
        self.port = 0
        self._to_port = port
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._dice = random.Random(1)

    async def start(self) -> None:
        listener = socket.create_server(("127.0.0.1", 0))
        # Small buffers, as a slow line has: what waits is to wait at the sender.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        self._server = await asyncio.start_server(self._join, sock=listener, limit=4096)
        self.port = listener.getsockname()[1]

    async def stop(self) -> None:
        if self._server is not None:
            self._server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _join(self, from_page: asyncio.StreamReader, to_page: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        try:
            outward = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            outward.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            outward.setblocking(False)
            await asyncio.get_running_loop().sock_connect(outward, ("127.0.0.1", self._to_port))
            from_server, to_server = await asyncio.open_connection(sock=outward, limit=4096)
            ways = [
                asyncio.create_task(self._pass_on(from_page, to_server, throttled=False)),
                asyncio.create_task(self._pass_on(from_server, to_page, throttled=True)),
            ]
            try:
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
                for end in (to_server, to_page):
                    end.close()
        except OSError:
            to_page.close()
        finally:
            self._tasks.discard(task)

    async def _pass_on(
        self, source: asyncio.StreamReader, sink: asyncio.StreamWriter, *, throttled: bool
    ) -> None:
        """Read what comes, and let it out again when its time has come."""
        line: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()
        letting_out = asyncio.create_task(self._let_out(line, sink))
        now_s = asyncio.get_running_loop().time
        free_s = 0.0
        try:
            while data := await source.read(_CHUNK_BYTES):
                while self.conditions.is_silent:
                    await asyncio.sleep(0.01)
                conditions = self.conditions
                free_s = max(free_s, now_s())
                if throttled and conditions.bytes_per_second:
                    free_s += len(data) / conditions.bytes_per_second
                    await asyncio.sleep(free_s - now_s())
                if conditions.stall_share and self._dice.random() < conditions.stall_share:
                    free_s += conditions.stall_s
                    await asyncio.sleep(conditions.stall_s)
                late_s = conditions.delay_s + self._dice.random() * conditions.jitter_s
                line.put_nowait((now_s() + late_s, data))
            line.put_nowait((now_s() + self.conditions.delay_s, b""))
            await letting_out
        except OSError:
            return
        finally:
            letting_out.cancel()
            await asyncio.gather(letting_out, return_exceptions=True)

    async def _let_out(
        self, line: asyncio.Queue[tuple[float, bytes]], sink: asyncio.StreamWriter
    ) -> None:
        now_s = asyncio.get_running_loop().time
        while True:
            due_s, data = await line.get()
            await asyncio.sleep(max(0.0, due_s - now_s()))
            while self.conditions.is_silent:
                await asyncio.sleep(0.01)
            if not data:
                return
            with contextlib.suppress(ConnectionError):
                sink.write(data)
                await sink.drain()
