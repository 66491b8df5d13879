"""A worker with an event loop, for bodies whose library has nothing but asyncio."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from typing import Any, TypeVar

from robot.clock import Clock

_T = TypeVar("_T")
_AGAIN_S = 0.5


class EventLoopThread:
    """Runs coroutines on a thread of its own, and keeps one connection if asked to.

    Args:
        name: The thread's.
        clock: Where the time comes from.

    Attributes:
        trouble: Why the connection that is kept was lost the last time; empty if it never was.
    """

    def __init__(self, name: str, clock: Clock) -> None:
        self.trouble = ""
        self._clock = clock
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name=name, daemon=True)
        self._thread.start()

    def submit(self, work: Coroutine[Any, Any, _T]) -> Future[_T]:
        """Have a coroutine run.

        Raises:
            ConnectionError: If the worker has ended.
        """
        if self._loop.is_closed():
            work.close()
            raise ConnectionError("the connection is closed")
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    def run(self, work: Coroutine[Any, Any, _T], timeout_s: float) -> _T:
        """Run a coroutine, and return what it returns.

        Raises:
            TimeoutError: If it takes longer; it is then cancelled.
            ConnectionError: If it fails, in whatever way.
        """

        async def in_time() -> _T:
            return await asyncio.wait_for(work, timeout_s)

        try:
            return self.submit(in_time()).result()
        except TimeoutError:
            raise
        except Exception as error:  # the libraries have many kinds of "it is gone"
            raise ConnectionError(said(error)) from error

    def keep(self, connect: Callable[[Callable[[], None]], Coroutine[Any, Any, None]]) -> None:
        """Connect, and again whenever the connection is lost; return once it stands.

        Args:
            connect: Gets what it is to call once it is connected; ends with the connection.

        Raises:
            ConnectionError: If the first attempt fails; the worker has then ended.
        """
        first: Future[None] = Future()

        def connected() -> None:
            if not first.done():
                first.set_result(None)

        async def stay_connected() -> None:
            while True:
                try:
                    await connect(connected)
                except Exception as error:
                    self.trouble = said(error)
                    if not first.done():
                        first.set_exception(ConnectionError(self.trouble))
                        return
                await self._clock.pause(_AGAIN_S)

        self.submit(stay_connected())
        try:
            first.result()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Cancel all that runs, and end; idempotent."""
        if not self._loop.is_closed():
            self.submit(self._cancel_all()).result()
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    async def _cancel_all(self) -> None:
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await self._clock.pause(0.01)  # transports close a little later


def said(error: Exception) -> str:
    """Return what an error says, or else its name."""
    return str(error) or type(error).__name__
