"""Time as an argument: all waiting goes through a clock.

In real time that is a plain wait. In virtual time it costs nothing, because the clock jumps to
the next event: `robot/testing/virtual_clock.py`.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

_T = TypeVar("_T")
Worker = threading.Thread
"""A thread that a clock has started."""


class Clock:
    """Monotonic seconds since an arbitrary start, and all the ways to wait for them to pass.

    This one is the machine's; jumps of the wall clock do not touch it.
    """

    def now_s(self) -> float:
        """Return the present time in seconds; it never goes backwards."""
        return time.perf_counter()  # `monotonic` goes by steps of 16 ms on Windows

    def wall_s(self) -> float:
        """Return seconds since 1970, for names and files; they may jump either way."""
        return time.time()

    def sleep(self, seconds: float) -> None:
        """Hold up this thread."""
        time.sleep(seconds)

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        """Hold up this thread until `event` is set or the time is up; True if it is set."""
        return event.wait(timeout_s)

    def result(self, future: Future[_T], timeout_s: float | None = None) -> _T:
        """Hold up this thread until `future` is done, and return or raise what it holds.

        Raises:
            TimeoutError: If it is not done in time.
        """
        return future.result(timeout_s)

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        """Return a reentrant lock whose holder may wait through this clock."""
        return threading.RLock()

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        """Run `target` on a daemon thread of its own, which may wait through this clock."""
        thread = threading.Thread(target=target, name=name, daemon=True)
        thread.start()
        return thread

    async def pause(self, seconds: float) -> None:
        """Hold up this task; with 0, let the others run once."""
        await asyncio.sleep(seconds)


RealClock = Clock
"""The clock's name in code that needs real time."""
