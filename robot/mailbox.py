"""What other threads leave for the loop: the pilot's commands, and requests to run in between."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from robot.types import PilotCommand

_T = TypeVar("_T")


class Mailbox:
    """Filled from any thread, emptied by the loop's. `wake` is set whenever something comes."""

    def __init__(self) -> None:
        self.wake = threading.Event()
        self._lock = threading.Lock()
        self._commands: list[PilotCommand] = []
        self._requests: deque[Callable[[], None]] = deque()

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

    def put_request(self, request: Callable[[], _T]) -> Future[_T]:
        """Leave something to be run on the loop's thread; the future has what comes of it."""
        future: Future[_T] = Future()

        def run() -> None:
            try:
                future.set_result(request())
            except Exception as error:  # handed to whoever asked; the loop goes on
                future.set_exception(error)

        with self._lock:
            self._requests.append(run)
        self.wake.set()
        return future

    def serve_requests(self) -> None:
        """Run all requests, in their order, those that come meanwhile included."""
        while True:
            with self._lock:
                if not self._requests:
                    return
                request = self._requests.popleft()
            request()
