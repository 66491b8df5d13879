"""`drivelesson serve` in a separate process, as a user starts it."""

from __future__ import annotations

import contextlib
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest

_ENDLESS = """
[limits]
messages_per_second = 1e12
messages_burst = 1e12
frames_per_second = 1e12
refused_before_closing = 1_000_000_000
requests_burst = 1e12
requests_per_second = 1e12
"""
"""A fast machine sends more requests than a pilot may; limits are tested in virtual time."""


@dataclass
class OwnProcess:
    """A running server: its address, its process, and its output so far."""

    process: subprocess.Popen[str]
    address: str = ""
    errors: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    @property
    def port(self) -> int:
        return int(self.address.rsplit(":", 1)[1])

    def metric(self, name: str) -> float:
        for line in httpx.get(self.address + "/metrics").text.splitlines():
            if line.startswith(f"drivelesson_{name} "):
                return float(line.rsplit(" ", 1)[1])
        raise AssertionError(f"no metric {name}")


@contextlib.contextmanager
def own_process(folder: Path, *more: str) -> Iterator[OwnProcess]:
    """While the `with` block runs, serve the simulated robot on a free port, without limits.

    Args:
        folder: The server's data folder.
        more: Further options.
    """
    pytest.importorskip("panda3d")
    settings = folder.with_name(f"{folder.name}.toml")
    settings.write_text(_ENDLESS)
    words = [sys.executable, "-m", "server", "--robot", "sim", "--port", "0"]
    process = subprocess.Popen(
        [*words, *more, "--data", str(folder), "--config", str(settings)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    stdout, stderr = process.stdout, process.stderr
    assert stdout is not None and stderr is not None
    running = OwnProcess(process)
    reading = threading.Thread(target=lambda: running.errors.extend(stderr), daemon=True)
    reading.start()
    try:
        said = iter(stdout.readline, "")
        found = next(filter(None, (re.search(r"https?://[^\s#]+", line) for line in said)), None)
        assert found is not None, "".join(running.errors)
        running.address = found[0].removesuffix("/pair")
        draining = threading.Thread(target=lambda: running.said.extend(said), daemon=True)
        draining.start()
        yield running
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60)
        reading.join(60)
        draining.join(60)
        stdout.close()
        stderr.close()
