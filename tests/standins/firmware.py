"""Runs the sample firmware in a process of Debian's micropython, whose pins print lines."""

from __future__ import annotations

import os
import select
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path
from typing import Self

import pytest

from tests.kit.needed import ROOT, missing

FIRMWARE = ROOT / "docs/examples/firmware/robot.py"
_MODULES = Path(__file__).parent / "board_modules"
SECRET = "geheim"


def find_micropython() -> str:
    """Return the program; skips visibly if it is missing, and fails in CI."""
    found = Path(shutil.which("micropython") or ROOT / "var/micropython/run")
    if not found.exists():
        missing("micropython", "tests/standins/get_micropython.sh var/micropython")
    return str(found)


def firmware(secret: bytes, port: int) -> str:
    """Return the firmware's source with these settings, as a person would edit them."""
    program = FIRMWARE.read_text()
    as_it_is = '"school", "chalk", b"change me", 4210'
    assert as_it_is in program
    return program.replace(as_it_is, f'"school", "chalk", {secret!r}, {port}')


class FirmwareRobot:
    """A running firmware on a separate port."""

    def __init__(self, secret: str = SECRET) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self._program = firmware(secret.encode(), self.port)
        self._moves: list[tuple[float, float, float]] = []

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def __enter__(self) -> Self:
        self.process = subprocess.Popen(
            [find_micropython(), "-c", self._program],
            stdout=subprocess.PIPE,
            env={**os.environ, "MICROPYPATH": f".frozen:{_MODULES}"},
        )
        self._printed = b""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("127.0.0.1", self.port))
            probe.settimeout(0.1)
            for _ in range(200):  # wait until the firmware has started
                try:
                    probe.send(b"{}")
                    probe.recv(600)
                    return self
                except OSError:
                    time.sleep(0.05)
        pytest.fail("the firmware does not answer")

    def __exit__(self, *error: object) -> None:
        self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        self.process.wait()
        if self.process.stdout is not None:
            self._read()
            self.process.stdout.close()

    def freeze(self) -> None:
        self.process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        self.process.send_signal(signal.SIGCONT)

    @property
    def moves(self) -> list[tuple[float, float, float]]:
        """The wheels' orders so far: (seconds, left, right), by the robot's clock.

        The robot sets its wheels before it reports, so a reported order is always in the list.
        """
        self._read()
        return self._moves

    def is_moving(self) -> bool:
        """Return the wheels' last order."""
        return any(any(move[1:]) for move in self.moves[-1:])

    def wait_until_it_stands(self, since: int = 0) -> None:
        """Wait until more than `since` orders have come and the last one is a stop."""
        end_s = time.monotonic() + 60.0
        while len(self.moves) <= since or self.is_moving():
            assert time.monotonic() < end_s, "the wheels did not stop"
            self._read(0.5)

    def _read(self, wait_s: float = 0.0) -> None:
        """Read the printed lines."""
        pipe = self.process.stdout
        while pipe and not pipe.closed and select.select([pipe], [], [], wait_s)[0]:
            new = os.read(pipe.fileno(), 1 << 16)
            *lines, self._printed = (self._printed + new).split(b"\n")
            for words in (line.split() for line in lines if line.startswith(b"wheels")):
                self._moves.append((int(words[1]) / 1000, float(words[2]), float(words[3])))
            wait_s = 0.0
            if not new:  # the firmware has ended
                return
