"""A virtual clock whose threads are greenlets, so that a busy computer does not slow them down.

Threads of `VirtualClock` take turns, and each turn waits until the system lets the next thread run:
milliseconds on a computer with much else to do. A greenlet runs on the same thread at once. The
library comes with Playwright.
"""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Callable
from typing import Any

from greenlet import getcurrent, greenlet

from robot.clock import Worker
from robot.testing.virtual_clock import VirtualClock, _Lock, _Waiting


class GreenClock(VirtualClock):
    """A virtual clock on one thread of the system; the threads that it starts are greenlets."""

    def __init__(self, start_s: float = 0.0) -> None:
        super().__init__(start_s)
        self.following: greenlet = getcurrent()

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        return _GreenThread(self, target, name)

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        return _GreenLock(self)

    def _make_waiting(self, event: threading.Event | None, due_s: float | None) -> _Waiting:
        return _GreenWaiting(self, event, due_s, getcurrent())


class _GreenWaiting(_Waiting):
    """A waiting greenlet. It is its own `turn`, because it has the two methods of a lock."""

    __slots__ = ("_clock", "_is_free", "who")

    def __init__(
        self,
        clock: GreenClock,
        event: threading.Event | None,
        due_s: float | None,
        who: greenlet,
    ) -> None:
        self.event, self.due_s, self.who = event, due_s, who
        self._clock, self._is_free = clock, False
        self.turn: Any = self

    def acquire(self) -> None:
        if not self._is_free:
            self._clock.following.switch()

    def release(self) -> None:
        self._is_free = True
        self._clock.following = self.who


class _GreenThread:
    """Replaces a thread: it waits for its first turn; when it ends, the next greenlet continues."""

    def __init__(self, clock: GreenClock, target: Callable[[], None], name: str) -> None:
        self.name = name
        self._clock, self._body = clock, target
        self._ended = threading.Event()
        clock._waiting.append(_GreenWaiting(clock, None, clock._base_s(), greenlet(self._run)))

    def _run(self, *_: object) -> None:  # a greenlet that ended has a result
        try:
            self._body()
        except Exception:
            sys.excepthook(*sys.exc_info())  # type: ignore[arg-type]
        self._ended.set()
        self._clock._hand_over()
        getcurrent().parent = self._clock.following  # this greenlet continues

    def join(self, timeout: float | None = None) -> None:
        self._clock.wait(self._ended, timeout)

    def is_alive(self) -> bool:
        return not self._ended.is_set()


class _GreenLock(_Lock):
    def _who(self) -> int:
        return id(getcurrent())
