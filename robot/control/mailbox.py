"""Queues from other threads to the loop: pilot commands, and requests to run between ticks."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import TypeVar

from robot.types import PilotCommand

_T = TypeVar("_T")


class Mailbox:
    """Filled from any thread, emptied by the loop's. `wake` is set whenever something is queued."""

    def __init__(self, wake: threading.Event | None = None) -> None:
        self.wake = wake or threading.Event()
        self._lock = threading.Lock()
        self._commands: list[PilotCommand] = []
        self._requests: deque[Callable[[], Callable[[], None]]] = deque()
        self._answers: list[Callable[[], None]] = []

    def put_command(self, command: PilotCommand) -> None:
        """Queue a pilot command."""
        with self._lock:
            self._commands.append(command)
        self.wake.set()

    def take_commands(self) -> list[PilotCommand]:
        """Return and remove all queued commands, oldest first."""
        with self._lock:
            commands, self._commands = self._commands, []
        return commands

    def put_request(self, request: Callable[[], _T], *, is_urgent: bool = False) -> Future[_T]:
        """Queue a request to be run on the loop's thread; before all others if it is urgent.

        Returns:
            A future with its result. It is done at the end of the tick that ran the request, when
            the state is published and every listener was called.
        """
        future: Future[_T] = Future()

        def run() -> Callable[[], None]:
            if not future.set_running_or_notify_cancel():  # it was cancelled
                return lambda: None
            try:
                result = request()
            except Exception as error:  # goes to the caller; the loop goes on
                return partial(future.set_exception, error)
            return partial(future.set_result, result)

        with self._lock:
            if is_urgent:
                self._requests.appendleft(run)
            else:
                self._requests.append(run)
        self.wake.set()
        return future

    def serve_requests(self) -> None:
        """Run all requests in order, including those that are queued meanwhile.

        Their results are held back until `answer_requests`.
        """
        while True:
            with self._lock:
                if not self._requests:
                    return
                request = self._requests.popleft()
            self._answers.append(request())

    def answer_requests(self) -> None:
        """Complete the futures of the requests that were run: the tick is over."""
        answers, self._answers = self._answers, []
        for answer in answers:
            answer()
