"""What other threads leave for the loop: the pilot's commands, and requests to run in between."""

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
    """Filled from any thread, emptied by the loop's. `wake` is set whenever something comes."""

    def __init__(self, wake: threading.Event | None = None) -> None:
        self.wake = wake or threading.Event()
        self._lock = threading.Lock()
        self._commands: list[PilotCommand] = []
        self._requests: deque[Callable[[], Callable[[], None]]] = deque()
        self._answers: list[Callable[[], None]] = []

    def put_command(self, command: PilotCommand) -> None:
        """Leave one word of the pilot."""
        with self._lock:
            self._commands.append(command)
        self.wake.set()

    def take_commands(self) -> list[PilotCommand]:
        """Take what the pilot said since the last time, oldest first; also to drop it."""
        with self._lock:
            commands, self._commands = self._commands, []
        return commands

    def put_request(self, request: Callable[[], _T], *, is_urgent: bool = False) -> Future[_T]:
        """Leave something to be run on the loop's thread; before all others if it is urgent.

        Returns:
            A future with what comes of it, done when the turn is that ran it: who waited for it
            finds the state published and every listener told.
        """
        future: Future[_T] = Future()

        def run() -> Callable[[], None]:
            if not future.set_running_or_notify_cancel():  # whoever asked does not want it any more
                return lambda: None
            try:
                result = request()
            except Exception as error:  # handed to whoever asked; the loop goes on
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
        """Run all requests, in their order, those that come meanwhile included.

        What comes of them is held back until `answer_requests`.
        """
        while True:
            with self._lock:
                if not self._requests:
                    return
                request = self._requests.popleft()
            self._answers.append(request())

    def answer_requests(self) -> None:
        """Tell those who asked what came of it: the turn is over."""
        answers, self._answers = self._answers, []
        for answer in answers:
            answer()
