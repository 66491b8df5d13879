"""The line to the process that holds the pins; it starts that process, and another if it hangs."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
from collections.abc import Sequence

from robot.clock import Clock

START_S = 10.0
"""Importing Python's libraries on a small Raspberry Pi takes seconds."""
HANGS_S = 0.3
"""A keeper that answers nothing for so long is killed; the next one stops the motors."""


class KeeperLine:
    """A line as `MessageLine` has it; OSError if the pins cannot be had."""

    def __init__(self, command: Sequence[str], clock: Clock) -> None:
        self._command, self._clock = command, clock
        self._start()

    def _start(self) -> None:
        self._rest = b""
        self._lines: list[bytes] = []
        self._waits_s: float | None = None
        self._has_ended = False
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl+C in a terminal ends the robot's program, which stops
            bufsize=0,
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._down, self._up = self._process.stdin.fileno(), self._process.stdout.fileno()
        os.set_blocking(self._down, False)
        said = self._next(START_S)
        if said != b"ready":
            self._end()
            raise ConnectionError(
                said.decode(errors="replace").removeprefix("failed ")
                if said
                else "the process that holds the pins did not start"
            )
        self._waits_s = None

    def send(self, message: bytes) -> None:
        """Write one line; a keeper that is gone or hangs is replaced, and the message dropped."""
        now_s = self._clock.now_s()
        if self._waits_s is None:
            self._waits_s = now_s
        if self._next(0.0) is not None:
            self._waits_s = now_s  # it answered, but later than anybody waited
        is_gone = self._has_ended or self._process.poll() is not None
        if is_gone or now_s - self._waits_s > HANGS_S:
            self._end()
            self._start()
            raise ConnectionError(
                f"the process that holds the pins {'ended' if is_gone else 'hung'}; "
                "another one has stopped the motors"
            )
        os.write(self._down, message + b"\n")

    def receive(self, timeout_s: float) -> bytes | None:
        line = self._next(timeout_s)
        if line is not None:
            self._waits_s = None
        return line

    def _next(self, timeout_s: float) -> bytes | None:
        if not self._lines and select.select([self._up], [], [], timeout_s)[0]:
            data = os.read(self._up, 65_536)
            self._has_ended = not data
            *self._lines, self._rest = (self._rest + data).split(b"\n")
        return self._lines.pop(0) if self._lines else None

    def close(self) -> None:
        """End the keeper, which stops the motors first; see `MessageLine`."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(2.0)
        self._end()

    def _end(self) -> None:
        with self._process:
            self._process.kill()
