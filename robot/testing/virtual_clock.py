"""A discrete-event clock: threads and tasks wait on it, and it jumps to the next event."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future
from typing import Any, TypeVar

from robot.clock import Clock, Worker

_T = TypeVar("_T")
WALL_START_S = 1_700_000_000.0
"""Wall-clock time at the start of a virtual clock, in seconds since 1970. It is the same in all
runs."""


class _Waiting:
    """A thread that waits until `event`, until `due_s`, or indefinitely."""

    __slots__ = ("due_s", "event", "turn")

    def __init__(self, event: threading.Event | None, due_s: float | None) -> None:
        self.event = event
        self.due_s = due_s
        self.turn = threading.Lock()  # a semaphore takes five times as long
        self.turn.acquire()


class VirtualClock(Clock):
    """A discrete-event clock: as soon as all threads wait, it jumps to the earliest deadline.

    While a thread runs, the clock stands still, so simulations run as fast as the machine can. The
    clock's threads run one at a time and switch only when they wait, so all runs of a program are
    equal. `run` and `runner` run asyncio programs, on an event loop that uses this clock's time and
    takes turns with the threads.

    Example:
        >>> clock = VirtualClock()
        >>> clock.sleep(3600.0)  # at once
        >>> clock.now_s()
        3600.0
    """

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s
        self._wall_ahead_s = WALL_START_S - start_s
        self._ahead_s = 0.0
        self._event_loop: _JumpingEventLoop | None = None
        self._event_loop_woken = threading.Event()
        self._waiting: list[_Waiting] = []
        self._deadlock: str | None = None

    def now_s(self) -> float:
        # `_base_s` is inlined because this method is called often
        event_loop, now_s = self._event_loop, self._now_s
        if event_loop is not None and event_loop.now_s > now_s:
            now_s = event_loop.now_s
        return now_s + self._ahead_s

    def wall_s(self) -> float:
        """Return seconds since 1970, which advance with `now_s`; `set_wall` makes them jump."""
        return self.now_s() + self._wall_ahead_s

    def set_wall(self, wall_s: float) -> None:
        """Set the wall clock forward or back; `now_s` does not change."""
        self._wall_ahead_s = wall_s - self.now_s()

    def _base_s(self) -> float:
        """Return the clock's time without the seconds that `advance` has added. While threads run,
        the event loop's time may lag behind the clock's time."""
        event_loop = self._event_loop
        return self._now_s if event_loop is None else max(self._now_s, event_loop.now_s)

    def advance(self, seconds: float) -> None:
        """Jump ahead by this time without running other threads, as when a computer wakes up."""
        if seconds < 0:
            raise ValueError(f"a clock cannot go back by {-seconds} s")
        self._ahead_s += seconds

    # Threads -----------------------------------------------------------------------------------

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        """Start a thread that runs while all others wait; see `Clock`."""
        return _VirtualThread(self, target, name)

    def sleep(self, seconds: float) -> None:
        self._let_others_run(None, seconds)

    def wait(self, event: threading.Event, timeout_s: float | None = None) -> bool:
        """Block this thread while others run; see `Clock`.

        A call on the event loop's thread blocks the event loop, as it would with a real clock.

        Raises:
            RuntimeError: If all threads wait indefinitely.
        """
        if not event.is_set():
            self._let_others_run(event, timeout_s)
        return event.is_set()

    def result(self, future: Future[_T], timeout_s: float | None = None) -> _T:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not self.wait(done, timeout_s):
            raise TimeoutError(f"not done within {timeout_s} s")
        return future.result(0)

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        return _Lock(self)

    def _make_waiting(self, event: threading.Event | None, due_s: float | None) -> _Waiting:
        return _Waiting(event, due_s)

    def _let_others_run(self, event: threading.Event | None, timeout_s: float | None) -> None:
        self._now_s = self._base_s()
        due_s = None if timeout_s is None else self._now_s + max(0.0, timeout_s)
        me = self._make_waiting(event, due_s)
        self._waiting.append(me)
        self._hand_over()
        me.turn.acquire()
        if self._deadlock is not None:
            raise RuntimeError(self._deadlock)

    def _hand_over(self) -> None:
        """Wake the next thread: a thread whose event is set, else the thread with the earliest
        deadline."""
        following = soonest = None
        for other in self._waiting:
            if other.event is not None and other.event.is_set():
                following = other
                break
            if other.due_s is not None and (soonest is None or other.due_s < soonest[0]):
                soonest = other.due_s, other
        if following is None:
            if soonest is None:
                self._deadlock = "every thread waits, and none has a deadline"
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
        """Run an asyncio program in virtual time, and return its result."""
        with self.runner() as runner:
            return runner.run(main)

    @contextlib.contextmanager
    def runner(self) -> Iterator[asyncio.Runner]:
        """Yield a runner of asyncio programs, whose event loop stands still between programs.

        All `asyncio` waits in these programs are virtual.
        """
        if self._event_loop is not None:
            raise RuntimeError("an event loop already runs on this clock")
        event_loop = self._event_loop = _JumpingEventLoop(self)
        try:
            with asyncio.Runner(loop_factory=lambda: event_loop) as runner:
                yield runner
        finally:
            self._now_s = self._base_s()
            self._event_loop = None

    async def pause(self, seconds: float) -> None:
        if self._event_loop is None:  # the caller runs on another event loop
            self.sleep(seconds)
            seconds = 0.0
        await asyncio.sleep(seconds)


class _Lock:
    """A reentrant lock for threads that run in virtual time. A thread that holds the lock may call
    the clock's `wait`."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._holder: int | None = None
        self._depth = 0
        self._free = threading.Event()

    def __enter__(self) -> None:
        me = self._who()
        while self._holder not in (None, me):
            self._free.clear()
            self._clock.wait(self._free)
        self._holder = me
        self._depth += 1

    def _who(self) -> int:
        return threading.get_ident()

    def __exit__(self, *error: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._holder = None
            self._free.set()


class _JumpingEventLoop(asyncio.SelectorEventLoop):
    """Asyncio's event loop with a clock in whole microseconds that jumps to the next timer.

    No sockets are polled: all events come from timers or from threads of the clock.
    """

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__()
        self._clock = clock
        self._clock_resolution = 1e-9  # with Windows' resolution of 16 ms, timers would fire early
        self._now_us = round(clock._now_s * 1e6)
        self.now_s = self._now_us / 1e6
        self._selector.select = self._let_time_pass  # type: ignore[attr-defined]

    def time(self) -> float:
        return self.now_s

    def _let_time_pass(self, timeout: float | None) -> list[Any]:
        """Wait for the next timer or for a thread's request; replaces the selector."""
        if timeout == 0:
            return []  # tasks are ready to run
        clock = self._clock
        if clock._waiting:
            clock._let_others_run(clock._event_loop_woken, timeout)
            clock._event_loop_woken.clear()
            timeout = clock._now_s - self.now_s
        elif timeout is None:
            raise RuntimeError("every task waits, and none has a deadline")
        if timeout > 0:
            self._now_us += max(1, round(timeout * 1e6))
            self.now_s = self._now_us / 1e6
        return []

    def call_soon_threadsafe(  # type: ignore[override]
        self, callback: Any, *args: Any, context: Any = None
    ) -> asyncio.Handle:
        """Wake the loop with an event, because its selector does not poll asyncio's socket."""
        self._clock._event_loop_woken.set()
        return self.call_soon(callback, *args, context=context)


class _VirtualThread(threading.Thread):
    """A thread that waits for its first turn, and wakes the next thread when it ends."""

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
            super().join()  # the thread has already woken the next thread, and ends now

    def is_alive(self) -> bool:
        return not self._ended.is_set()
