"""Time as an argument: the machine's clock, and one moved by hand.

Whatever waits does so through its clock. In real time that is a plain wait; in virtual time it
costs nothing, because the clock moves to the end of the wait. A third clock, for tests, jumps to
whatever happens next: `robot/testing/virtual_clock.py`.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol, TypeVar

_T = TypeVar("_T")
WALL_START_S = 1_700_000_000.0
"""Seconds since 1970 at the start of a clock that is not the machine's: the same in every run."""


class Worker(Protocol):
    """A thread that a clock has started."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end, at most `timeout` seconds."""

    def is_alive(self) -> bool:
        """True until its target has returned."""


class Clock(Protocol):
    """Monotonic seconds since an arbitrary start, and all the ways to wait for them to pass."""

    def now_s(self) -> float:
        """Return the present time in seconds; it never goes backwards."""

    def wall_s(self) -> float:
        """Return seconds since 1970, for names and files; they may jump either way."""

    def sleep(self, seconds: float) -> None:
        """Hold up this thread."""

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        """Hold up this thread until `event` is set or the time is up; True if it is set."""

    def result(self, future: Future[_T], timeout_s: float | None = None) -> _T:
        """Hold up this thread until `future` is done, and return or raise what it holds.

        Raises:
            TimeoutError: If it is not done in time.
        """

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        """Return a reentrant lock whose holder may wait through this clock."""

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        """Run `target` on a daemon thread of its own, which may wait through this clock."""

    async def pause(self, seconds: float) -> None:
        """Hold up this task; with 0, let the others run once."""


class RealClock:
    """The machine's monotonic clock; jumps of the wall clock do not touch it."""

    def now_s(self) -> float:
        return time.perf_counter()  # `monotonic` goes by steps of 16 ms on Windows

    def wall_s(self) -> float:
        return time.time()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        return event.wait(timeout_s)

    def result(self, future: Future[_T], timeout_s: float | None = None) -> _T:
        return future.result(timeout_s)

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        return threading.RLock()

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        thread = threading.Thread(target=target, name=name, daemon=True)
        thread.start()
        return thread

    async def pause(self, seconds: float) -> None:
        await asyncio.sleep(seconds)


class ManualClock:
    """A clock that stands until it is moved: simulations run on it faster than real time.

    It has no other threads to wait for, so a wait moves it to the end of the wait.
    """

    def __init__(self, start_s: float = 0.0, wall_start_s: float = WALL_START_S) -> None:
        self._now_s = start_s
        self._wall_ahead_s = wall_start_s - start_s

    def now_s(self) -> float:
        """Return the time that the clock was last moved to."""
        return self._now_s

    def wall_s(self) -> float:
        """Return seconds since 1970, which go with `now_s` but for `set_wall`."""
        return self.now_s() + self._wall_ahead_s

    def set_wall(self, wall_s: float) -> None:
        """Set the wall clock, forwards or back; `now_s` does not notice."""
        self._wall_ahead_s = wall_s - self.now_s()

    def advance(self, seconds: float) -> None:
        """Move the clock on by `seconds`.

        Raises:
            ValueError: If `seconds` is negative.
        """
        if seconds < 0:
            raise ValueError(f"a clock cannot go back by {-seconds} s")
        self._now_s += seconds

    def sleep(self, seconds: float) -> None:
        """Move the clock on by `seconds`."""
        self.advance(max(0.0, seconds))

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        """Move the clock to the end of the wait, unless `event` is set.

        Raises:
            RuntimeError: If `timeout_s` is None: nobody is there to set the event.
        """
        if not event.is_set():
            if timeout_s is None:
                raise RuntimeError("waits for ever: nobody is there to set the event")
            self.sleep(timeout_s)
        return event.is_set()

    def result(self, future: Future[_T], timeout_s: float | None = None) -> _T:
        """Return what `future` holds; see `Clock`."""
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not self.wait(done, timeout_s):
            raise TimeoutError(f"not done within {timeout_s} s")
        return future.result(0)

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        """Return a lock that is waited for through this clock; see `Clock`."""
        return _Lock(self)

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        """Refuse: `VirtualClock` can wait for threads."""
        raise RuntimeError(f"the thread {name!r} needs a VirtualClock or the real one")

    async def pause(self, seconds: float) -> None:
        """Move the clock on by `seconds`, and let other tasks run once."""
        self.sleep(seconds)
        await asyncio.sleep(0)


class _Lock:
    """A reentrant lock whose holder may wait through the clock while others want it."""

    def __init__(self, clock: ManualClock) -> None:
        self._clock = clock
        self._holder: int | None = None
        self._depth = 0
        self._free = threading.Event()

    def __enter__(self) -> None:
        me = threading.get_ident()
        while self._holder not in (None, me):
            self._free.clear()
            self._clock.wait(self._free)
        self._holder = me
        self._depth += 1

    def __exit__(self, *error: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._holder = None
            self._free.set()
