"""Runs servers of asyncio on a separate thread, and ends them without losing a connection."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


async def stop_accepting(server: Any) -> None:
    """Wait until the server knows every accepted connection, so that it can close them all.

    asyncio of Python 3.11 loses a connection if `Server.close()` comes between its acceptance and
    the loop's next turn. The garbage collector closes the lost connection later, and warns in
    another test.
    """
    for listener in server.sockets or ():
        asyncio.get_running_loop().remove_reader(listener.fileno())
    await asyncio.sleep(0)


class LoopThread:
    """An event loop on a separate thread; its servers (asyncio or websockets) end with the loop."""

    def __init__(self) -> None:
        self.event_loop = asyncio.new_event_loop()
        self._servers: list[Any] = []
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self.event_loop) as runner:
            runner.get_loop().run_forever()

    def do(self, work: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine on the thread's loop, and return its result."""
        return asyncio.run_coroutine_threadsafe(work, self.event_loop).result(60)

    def serve(self, begin: Callable[[], Any]) -> int:
        """Start the server that `begin` returns on the thread's loop, and return its port."""

        async def start() -> Any:
            return await begin()

        self._servers.append(server := self.do(start()))
        return int(next(iter(server.sockets)).getsockname()[1])

    async def _end(self) -> None:
        for server in self._servers:
            await stop_accepting(server)
            server.close()
            await server.wait_closed()

    def close(self) -> None:
        self.do(self._end())
        self.event_loop.call_soon_threadsafe(self.event_loop.stop)
        self._thread.join()
