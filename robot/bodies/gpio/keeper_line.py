"""The connection to the keeper, the process that owns the pins; replaces a keeper that hangs."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Sequence
from multiprocessing import Pipe

from robot.bodies.gpio.keeper import FAILED, READY
from robot.clock import Clock

START_S = 30.0
"""Time limit for a keeper to start, in seconds. Python's imports are slow on a small Raspberry
Pi."""
HANGS_S = 0.3
"""Time without an answer after which a keeper is killed, in seconds. Its replacement stops the
motors."""


class KeeperLine:
    """A `MessageLine` to the keeper process. Raises OSError if the keeper cannot claim the pins."""

    def __init__(self, command: Sequence[str], clock: Clock) -> None:
        self._command, self._clock = command, clock
        self._trouble = "the process that holds the pins did not start"
        """The reason why no keeper owns the pins now; empty if a keeper owns them."""
        self._start()
        self._next(START_S)
        if self._trouble:
            self._end()
            raise ConnectionError(self._trouble)

    def _start(self) -> None:
        self._has_ended = False
        self._waits_s: float | None = None
        self._pipe, theirs = Pipe()
        with theirs:
            self._process = subprocess.Popen(
                self._command,
                stdin=theirs.fileno(),
                start_new_session=True,  # Ctrl+C must end only the robot's program
            )

    def send(self, message: bytes) -> None:
        """Send one message without waiting; it is dropped while no keeper owns the pins."""
        now_s = self._clock.now_s()
        if self._waits_s is None:
            self._waits_s = now_s
        if self._next(0.0) is not None:
            self._waits_s = now_s  # this is an answer to an earlier order, so wait again
        silent_s = now_s - self._waits_s
        if self._has_ended or silent_s > START_S:
            self._trouble = self._trouble or "it ended, and is being restarted"
            self._end()
            self._start()
        elif not self._trouble and silent_s > HANGS_S:
            self._trouble = "it hung, and is being replaced"
            self._process.send_signal(signal.SIGUSR1)
        if self._trouble:
            raise ConnectionError(self._trouble)
        self._pipe.send_bytes(message)

    def receive(self, timeout_s: float) -> bytes | None:
        line = self._next(timeout_s)
        if line is not None:
            self._waits_s = None
        return line

    def _next(self, timeout_s: float) -> bytes | None:
        try:
            line = self._pipe.recv_bytes() if self._pipe.poll(timeout_s) else None
        except (EOFError, OSError):
            self._has_ended = True
            return None
        if line == READY:
            self._trouble = ""
        elif line is not None and line.startswith(FAILED):
            self._trouble = line.removeprefix(FAILED).decode(errors="replace")
        return line

    def close(self) -> None:
        """End the keeper, which stops the motors first; see `MessageLine`."""
        self._pipe.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(2.0)
        self._end()

    def _end(self) -> None:
        """Kill the remaining keepers."""
        self._pipe.close()
        with self._process, contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
