"""Requests from other threads to the loop, which runs the requests between two ticks."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, TypeVar

_T = TypeVar("_T")


class Mailbox:
    """A queue that any thread fills and the loop's thread empties. `wake` is set when a request is
    due now."""

    def __init__(self) -> None:
        self.wake = threading.Event()
        self._requests: deque[tuple[Future[Any] | None, Callable[[], Any]]] = deque()
        self.answers: list[Callable[[], None]] = []
        """The results of the requests of this tick, until `answer` is called."""

    def put(self, request: Callable[[], _T], *, is_urgent: bool = False) -> Future[_T]:
        """Queue a request to be run on the loop's thread; an urgent request runs before all others.

        Everything that reads or changes the training history is put here: undo, edits, saving,
        replacing. The future is done at the end of the tick that ran the request, after the state
        was published and every listener was called.
        """
        future: Future[_T] = Future()
        add = self._requests.appendleft if is_urgent else self._requests.append
        add((future, request))
        self.wake.set()
        return future

    def note(self, request: Callable[[], None], *, is_news: bool) -> None:
        """Queue a request without an answer, which must not raise. With `is_news` False it does not
        wake the loop but runs in the next tick, at most 50 ms later."""
        self._requests.append((None, request))
        if is_news:
            self.wake.set()

    def serve(self) -> None:
        """Run all requests in order, including requests that are queued while others run.

        The results are held back until `answer` is called.
        """
        while self._requests:
            future, request = self._requests.popleft()
            if future is None:
                request()
                continue
            if not future.set_running_or_notify_cancel():  # the caller cancelled the request
                continue
            try:
                self.answers.append(partial(future.set_result, request()))
            except Exception as error:  # pass the error to the caller; the loop goes on
                self.answers.append(partial(future.set_exception, error))

    def answer(self) -> None:
        """Complete the futures of the requests that were run, because the tick is over."""
        answers, self.answers = self.answers, []
        for answer in answers:
            answer()
