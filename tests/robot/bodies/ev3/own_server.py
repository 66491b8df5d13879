"""A server that moves a brick, in a separate process."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.robot.bodies.ev3.film import ROOT


@contextmanager
def own_server(*options: str, **environment: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Serve with these options inside the block; yield the process and its address."""
    command = [sys.executable, "-m", "server", "serve", "--learner", "published", "--port", "0"]
    process, address = _start([*command, *options], environment)
    try:
        yield process, f"ws://{address}"
    finally:
        _end(process)


def _start(command: list[str], environment: dict[str, str]) -> tuple[subprocess.Popen[str], str]:
    """Start it again if it ended: a machine that is paused loses the brick."""
    for _ in range(5):
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert process.stdout is not None
        for line in process.stdout:
            if match := re.search(r"http://(\S+)", line):
                return process, match[1]
        _end(process)
    pytest.fail("the server ended")


def _end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()
    assert process.stdout is not None
    process.stdout.close()
