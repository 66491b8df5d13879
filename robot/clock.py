"""Time as an argument: the machine's clock, one moved by hand, and one that jumps.

Whatever waits does so through its clock. In real time that is a plain wait; in virtual time it
costs nothing, because the clock jumps to the moment at which something happens next.

One file because the clocks are one interface in three forms: what one can do, all must.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future
from typing import Any, Protocol, TypeVar

_T = TypeVar("_T")
_WALL_START_S = 1_700_000_000.0
"""Seconds since 1970 at the start of a virtual clock: the same in every run."""


class Worker(Protocol):
    """A thread that a clock has started."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end, at most `timeout` seconds."""
        ...

    def is_alive(self) -> bool:
        """True until its target has returned."""
        ...


class Clock(Protocol):
    """Monotonic seconds since an arbitrary start, and all the ways to wait for them to pass."""

    def now_s(self) -> float:
        """Return the present time in seconds; it never goes backwards."""
        ...

    def wall_s(self) -> float:
        """Return seconds since 1970, for names and files; they may jump either way."""
        ...

    def sleep(self, seconds: float) -> None:
        """Hold up this thread."""
        ...

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        """Hold up this thread until `event` is set or the time is up; True if it is set."""
        ...

    def result(self, future: Future[_T], timeout_s: float | None = None) -> _T:
        """Hold up this thread until `future` is done, and return or raise what it holds.

        Raises:
            TimeoutError: If it is not done in time.
        """
        ...

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        """Return a reentrant lock whose holder may wait through this clock."""
        ...

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        """Run `target` on a daemon thread of its own, which may wait through this clock."""
        ...

    async def pause(self, seconds: float) -> None:
        """Hold up this task; with 0, let the others run once."""
        ...


class RealClock:
    """The machine's monotonic clock; jumps of the wall clock do not touch it."""

    def now_s(self) -> float:
        """Return `time.monotonic()`."""
        return time.monotonic()

    def wall_s(self) -> float:
        """Return `time.time()`."""
        return time.time()

    def sleep(self, seconds: float) -> None:
        """Hold up this thread; see `Clock`."""
        time.sleep(seconds)

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        """Hold up this thread until `event`; see `Clock`."""
        return event.wait(timeout_s)

    def result(self, future: Future[_T], timeout_s: float | None = None) -> _T:
        """Hold up this thread until `future` is done; see `Clock`."""
        return future.result(timeout_s)

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        """Return a `threading.RLock`."""
        return threading.RLock()

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        """Start a daemon thread; see `Clock`."""
        thread = threading.Thread(target=target, name=name, daemon=True)
        thread.start()
        return thread

    async def pause(self, seconds: float) -> None:
        """Hold up this task; see `Clock`."""
        await asyncio.sleep(seconds)


class ManualClock:
    """A clock that stands until it is moved: simulations run on it faster than real time.

    It has no other threads to wait for, so a wait moves it to the end of the wait.
    """

    def __init__(self, start_s: float = 0.0, wall_start_s: float = _WALL_START_S) -> None:
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


class _Waiting:
    """A thread that is held up: until `event`, or `due_s`, or for ever."""

    __slots__ = ("due_s", "event", "turn")

    def __init__(self, event: threading.Event | None, due_s: float | None) -> None:
        self.event = event
        self.due_s = due_s
        self.turn = threading.Lock()  # a semaphore would cost five times as much
        self.turn.acquire()


class VirtualClock(ManualClock):
    """Discrete events: as soon as everybody waits, the clock jumps to whoever waits shortest.

    Threads that it started run one at a time and change only where they wait, so a run is the
    same each time. An asyncio program runs on `run` or a `runner`, whose event loop has this
    clock's time and takes turns with the threads.
    """

    def __init__(self, start_s: float = 0.0, wall_start_s: float = _WALL_START_S) -> None:
        super().__init__(start_s, wall_start_s)
        self._ahead_s = 0.0
        self._event_loop: _JumpingEventLoop | None = None
        self._event_loop_woken = threading.Event()
        self._waiting: list[_Waiting] = []
        self._deadlock: str | None = None

    def now_s(self) -> float:
        """Return the present virtual time in seconds."""
        event_loop, now_s = self._event_loop, self._now_s  # as `_base_s`: it is asked all the time
        if event_loop is not None and event_loop.now_s > now_s:
            now_s = event_loop.now_s
        return now_s + self._ahead_s

    def _base_s(self) -> float:
        """Return the time without jumps; the event loop's falls behind while threads run."""
        event_loop = self._event_loop
        return self._now_s if event_loop is None else max(self._now_s, event_loop.now_s)

    def advance(self, seconds: float) -> None:
        """Jump ahead without anybody having waited, as when a computer was asleep."""
        if seconds < 0:
            raise ValueError(f"a clock cannot go back by {-seconds} s")
        self._ahead_s += seconds

    # Threads -----------------------------------------------------------------------------------

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        """Start a thread that runs while all others wait; see `Clock`."""
        return _VirtualThread(self, target, name)

    def sleep(self, seconds: float) -> None:
        """Hold up this thread for `seconds` of virtual time."""
        self._let_others_run(None, seconds)

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        """Hold up this thread while others run; see `Clock`.

        On the event loop's own thread it holds up the whole loop, as it would in real time.

        Raises:
            RuntimeError: If every thread waits for ever.
        """
        if not event.is_set():
            self._let_others_run(event, timeout_s)
        return event.is_set()

    def _let_others_run(self, event: threading.Event | None, timeout_s: float | None) -> None:
        self._now_s = self._base_s()
        due_s = None if timeout_s is None else self._now_s + max(0.0, timeout_s)
        me = _Waiting(event, due_s)
        self._waiting.append(me)
        self._hand_over()
        me.turn.acquire()
        if self._deadlock is not None:
            raise RuntimeError(self._deadlock)

    def _hand_over(self) -> None:
        """Wake the next thread: one whose event is set, or else whose time comes first."""
        following = soonest = None
        for other in self._waiting:
            if other.event is not None and other.event.is_set():
                following = other
                break
            if other.due_s is not None and (soonest is None or other.due_s < soonest[0]):
                soonest = other.due_s, other
        if following is None:
            if soonest is None:
                self._deadlock = "every thread waits for ever"
                held_up, self._waiting = self._waiting, []
                for other in held_up:
                    other.turn.release()
                return
            due_s, following = soonest
            self._now_s = max(self._now_s, due_s)
        self._waiting.remove(following)
        following.turn.release()

    # Tasks -------------------------------------------------------------------------------------

    def run(self, main: Coroutine[Any, Any, _T]) -> _T:
        """Run an asyncio program in virtual time, and return what comes of it."""
        with self.runner() as runner:
            return runner.run(main)

    @contextlib.contextmanager
    def runner(self) -> Iterator[asyncio.Runner]:
        """Give a runner of asyncio programs, whose event loop stands still in between.

        Every `asyncio` wait within it is virtual.
        """
        if self._event_loop is not None:
            raise RuntimeError("an event loop runs on this clock already")
        event_loop = self._event_loop = _JumpingEventLoop(self)
        try:
            with asyncio.Runner(loop_factory=lambda: event_loop) as runner:
                yield runner
        finally:
            self._now_s = self._base_s()
            self._event_loop = None

    async def pause(self, seconds: float) -> None:
        """Hold up this task for `seconds` of virtual time."""
        await asyncio.sleep(seconds)


class _JumpingEventLoop(asyncio.SelectorEventLoop):
    """Asyncio's own, whose time is counted in whole microseconds and jumps to the next timer.

    Nothing is polled: what happens, happens on a timer or on a thread of the clock.
    """

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__()
        self._clock = clock
        self._now_us = round(clock._now_s * 1e6)
        self.now_s = self._now_us / 1e6
        self._selector.select = self._let_time_pass  # type: ignore[attr-defined]

    def time(self) -> float:
        return self.now_s

    def _let_time_pass(self, timeout: float | None) -> list[Any]:
        """Wait, in place of the selector: up to the next timer, or to what a thread asks for."""
        if timeout == 0:
            return []  # tasks are ready
        clock = self._clock
        if clock._waiting:
            clock._let_others_run(clock._event_loop_woken, timeout)
            clock._event_loop_woken.clear()
            timeout = clock._now_s - self.now_s
        elif timeout is None:
            raise RuntimeError("every task waits for ever")
        if timeout > 0:
            self._now_us += max(1, round(timeout * 1e6))
            self.now_s = self._now_us / 1e6
        return []

    def call_soon_threadsafe(  # type: ignore[override]
        self, callback: Any, *args: Any, context: Any = None
    ) -> asyncio.Handle:
        """Spare the self-pipe: whoever calls this holds up the loop already."""
        self._clock._event_loop_woken.set()
        return self.call_soon(callback, *args, context=context)


class _VirtualThread(threading.Thread):
    """Waits for its first turn, and hands over when it ends."""

    def __init__(self, clock: VirtualClock, target: Callable[[], None], name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._clock, self._body = clock, target
        self._first = _Waiting(None, clock._base_s())
        self._ended = threading.Event()
        clock._waiting.append(self._first)
        self.start()

    def run(self) -> None:
        self._first.turn.acquire()
        try:
            if self._clock._deadlock is None:
                self._body()
        finally:
            self._ended.set()
            self._clock._hand_over()

    def join(self, timeout: float | None = None) -> None:
        if self._clock.wait(self._ended, timeout):
            super().join()  # it has handed over, and is a step from its end

    def is_alive(self) -> bool:
        return not self._ended.is_set()


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
