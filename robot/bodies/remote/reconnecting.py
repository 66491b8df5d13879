"""Connections maintained by a thread, for bodies whose library supports only asyncio."""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from typing import Any

from robot.clock import Clock

_AGAIN_S = 0.5
_MOST_WAITING = 20


class ReconnectingConnection(ABC):
    """A connection that a separate thread maintains, and opens again after a loss.

    If the connection is lost while a message is sent, the message is not sent again, because a late
    order must not move a robot.

    Attributes:
        trouble: The reason for the last loss; empty if there was none.

    Raises:
        OSError: If the first connection fails.
    """

    def __init__(self, name: str, clock: Clock) -> None:
        self.trouble = ""
        self._clock = clock
        self._sending: dict[str, Future[None]] = {}
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name=name, daemon=True)
        self._thread.start()
        first: Future[None] = Future()
        self._submit(self._keep(first))
        try:
            first.result()
        except BaseException:
            self.close()
            raise

    @abstractmethod
    async def _connect_once(self, connected: Callable[[], None]) -> None:
        """Connect, call `connected`, and return when the connection is lost."""

    async def _keep(self, first: Future[None]) -> None:
        def connected() -> None:
            if not first.done():
                first.set_result(None)

        while True:
            try:
                await self._connect_once(connected)
            except Exception as error:
                self.trouble = _reason_of(error)
                if not first.done():
                    first.set_exception(ConnectionError(self.trouble))
                    return
            await self._clock.pause(_AGAIN_S)

    def _send_one(self, work: Coroutine[Any, Any, None], key: str = "") -> Future[None]:
        """Send a message. The message is refused while the previous message is still being sent.

        Raises:
            ConnectionError: If the message is refused or the connection was closed. If sending
                fails afterwards, the returned future raises ConnectionError.
        """
        before = self._sending.get(key)
        if before is not None and not before.done():
            work.close()
            raise ConnectionError("the previous message has not been sent yet")
        self._sending[key] = sending = self._submit(work)
        return sending

    def _submit(self, work: Coroutine[Any, Any, None]) -> Future[None]:
        if self._loop.is_closed():
            work.close()
            raise ConnectionError("the connection is closed")
        return asyncio.run_coroutine_threadsafe(_or_connection_error(work), self._loop)

    def close(self) -> None:
        """Cancel all tasks and end the thread; idempotent."""
        if not self._loop.is_closed():
            self._submit(self._cancel_all()).result()
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    async def _cancel_all(self) -> None:
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await self._clock.pause(0.01)  # give the transports time to close


class ReconnectingLink(ReconnectingConnection):
    """A maintained connection that receives messages: a `MessageLine`."""

    def __init__(self, name: str, clock: Clock) -> None:
        self._received: queue.Queue[bytes] = queue.Queue(_MOST_WAITING)
        super().__init__(name, clock)

    def _take_message(self, message: bytes) -> None:
        if self._received.full():
            with contextlib.suppress(queue.Empty):
                # drop an unread message, because only the newest message counts
                self._received.get_nowait()
        self._received.put_nowait(message)

    def receive(self, timeout_s: float) -> bytes | None:
        try:
            return self._received.get(timeout_s > 0, timeout_s)
        except queue.Empty:
            return None


async def _or_connection_error(work: Coroutine[Any, Any, None]) -> None:
    try:
        await work
    except Exception as error:  # libraries report a lost connection by many types of errors
        raise ConnectionError(_reason_of(error)) from error


def _reason_of(error: Exception) -> str:
    return str(error) or type(error).__name__
