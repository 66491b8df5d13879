"""Runs a program in a console of Windows, in which a test can press Ctrl-C or close the window."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import subprocess
import termios
import threading
from pathlib import Path
from typing import Self

from .python_for_windows import environment, python

END_S = 60


class Console:
    """Runs Windows' Python with these arguments; its output is collected in `said`."""

    def __init__(self, folder: Path, *words: str) -> None:
        self._master, slave = pty.openpty()
        self.process = subprocess.Popen(
            python(*words),
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=folder,
            env={**environment(), "TERM": "xterm"},
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(slave)
        self.said = bytearray()
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # the console no longer exists
            while data := os.read(self._master, 4096):
                self.said += data

    def press_ctrl_c(self) -> int:
        """Press Ctrl-C; return the exit status."""
        os.write(self._master, b"\x03")
        return self.process.wait(END_S)

    def close(self) -> int:
        """Close the window; return the exit status."""
        os.close(self._master)
        self._master = -1
        return self.process.wait(END_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.process.kill()
        self.process.wait()
        if self._master >= 0:
            os.close(self._master)
