"""The clock with which all code reads the time and waits; it is passed as an argument.

In real time the clock simply waits. In virtual time a wait takes no time, because the clock jumps
to the next event: `robot/testing/virtual_clock.py`.
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
"""A thread that was started through a clock."""


class Clock:
    """Tells the time in monotonic seconds since an arbitrary start, and offers all ways to wait.

    The base class uses the machine's clock. Jumps of the wall clock do not affect it.
    """

    def now_s(self) -> float:
        """Return the present time in seconds; it never goes backwards."""
        return time.perf_counter()  # `monotonic` has a resolution of 16 ms on Windows

    def wall_s(self) -> float:
        """Return seconds since 1970, for names and files; the value may jump forward or back."""
        return time.time()

    def sleep(self, seconds: float) -> None:
        """Block this thread."""
        time.sleep(seconds)

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        """Block this thread until `event` is set or the time is up; return whether it is set."""
        return event.wait(timeout_s)

    def result(self, future: Future[_T], timeout_s: float | None = None) -> _T:
        """Block this thread until `future` is done; return its result or raise its exception.

        Raises:
            TimeoutError: If `future` is not done in time.
        """
        return future.result(timeout_s)

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        """Return a reentrant lock whose holder may wait through this clock."""
        return threading.RLock()

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        """Run `target` on a new daemon thread, which may wait through this clock."""
        thread = threading.Thread(target=target, name=name, daemon=True)
        thread.start()
        return thread

    async def pause(self, seconds: float) -> None:
        """Suspend this asyncio task; with 0 seconds, let the other tasks run once."""
        await asyncio.sleep(seconds)


RealClock = Clock
"""Another name of `Clock`, for code that works only in real time."""
