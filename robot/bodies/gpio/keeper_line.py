"""The line to the process that holds the pins; it starts that process, and another if it hangs."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Sequence
from multiprocessing import Pipe

from robot.bodies.gpio.keeper import FAILED, READY
from robot.clock import Clock

START_S = 30.0
"""Importing Python's libraries on a small Raspberry Pi takes seconds."""
HANGS_S = 0.3
"""A keeper that answers nothing for so long is killed; the next one stops the motors."""


class KeeperLine:
    """A line as `MessageLine` has it; OSError if the pins cannot be had."""

    def __init__(self, command: Sequence[str], clock: Clock) -> None:
        self._command, self._clock = command, clock
        self._start()

    def _start(self) -> None:
        self._has_ended = False
        self._pipe, theirs = Pipe()
        with theirs:
            self._process = subprocess.Popen(
                self._command,
                stdin=theirs.fileno(),
                start_new_session=True,  # Ctrl+C ends the robot's program, which stops
            )
        said = self._next(START_S)
        if said != READY:
            self._end()
            raise ConnectionError(
                said.decode(errors="replace").removeprefix(FAILED.decode())
                if said
                else "the process that holds the pins did not start"
            )
        self._waits_s: float | None = None

    def send(self, message: bytes) -> None:
        """Send one message; a keeper that is gone or hangs is replaced, and the message dropped."""
        now_s = self._clock.now_s()
        if self._waits_s is None:
            self._waits_s = now_s
        if self._next(0.0) is not None:
            self._waits_s = now_s  # it answered, but later than anybody waited
        if self._has_ended or now_s - self._waits_s > HANGS_S:
            said = "ended" if self._has_ended else "hung"
            self._end()
            self._start()
            raise ConnectionError(
                f"the process that holds the pins {said}; another one has stopped the motors"
            )
        self._pipe.send_bytes(message)

    def receive(self, timeout_s: float) -> bytes | None:
        line = self._next(timeout_s)
        if line is not None:
            self._waits_s = None
        return line

    def _next(self, timeout_s: float) -> bytes | None:
        try:
            return self._pipe.recv_bytes() if self._pipe.poll(timeout_s) else None
        except (EOFError, OSError):
            self._has_ended = True
            return None

    def close(self) -> None:
        """End the keeper, which stops the motors first; see `MessageLine`."""
        self._pipe.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(2.0)
        self._end()

    def _end(self) -> None:
        self._pipe.close()
        with self._process:
            self._process.kill()
