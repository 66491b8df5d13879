"""`drivelesson serve` in a separate process, as a user starts it."""

import contextlib
import os
import re
import signal
import socket
import ssl
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
class Served:
    """A running server: its address, its process, and its output so far."""

    process: subprocess.Popen[str]
    address: str = ""
    errors: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    @property
    def port(self) -> int:
        return int(self.address.rsplit(":", 1)[1])

    @property
    def drive_url(self) -> str:
        """The address of a pilot's websocket."""
        return self.address.replace("http", "ws", 1) + "/ws/drive"

    def metric(self, name: str) -> float:
        for line in httpx.get(self.address + "/metrics").text.splitlines():
            if line.startswith(f"drivelesson_{name} "):
                return float(line.rsplit(" ", 1)[1])
        raise AssertionError(f"no metric {name}")

    @contextlib.contextmanager
    def unfinished(self) -> Iterator[None]:
        """While the `with` block runs, keep open a silent connection, half a handshake, half a
        request and half an upload, which the server has read."""
        unchecked = ssl.create_default_context()
        unchecked.check_hostname, unchecked.verify_mode = False, ssl.CERT_NONE
        host = b" HTTP/1.1\r\nHost: 127.0.0.1\r\n"
        upload = b"PUT /api/models/m/file" + host + b"Content-Length: 999\r\n\r\nx"
        with contextlib.ExitStack() as stack:
            for data in (b"", b"\x16\x03\x01\x02\x00\x01\x00", b"GET /" + host, upload):
                line = socket.create_connection(("127.0.0.1", self.port))
                if self.address.startswith("https") and data.endswith((b"\n", b"x")):
                    line = unchecked.wrap_socket(line)
                stack.enter_context(line).sendall(data)
            httpx.get(self.address + "/healthz", verify=False)
            yield


@contextlib.contextmanager
def served(
    folder: Path, *words: str, python: str | Path = sys.executable, **environ: str
) -> Iterator[Served]:
    """While the `with` block runs, serve a robot on a free port, without limits.

    Args:
        folder: The server's data folder.
        words: Further options; without a robot, the simulated one is served.
        python: An interpreter that has the program.
        environ: Further variables of its environment.
    """
    if "--robot" not in words:
        pytest.importorskip("panda3d")
    settings = folder.with_name(f"{folder.name}.toml")
    settings.parent.mkdir(parents=True, exist_ok=True)
    settings.write_text(_ENDLESS)
    command = [python, "-m", "server", "--robot", "sim", "--port", "0", *words]
    process = subprocess.Popen(
        [*command, "--data", folder, "--config", settings],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1", **environ},
    )
    stdout, stderr = process.stdout, process.stderr
    assert stdout is not None and stderr is not None
    running = Served(process)
    reading = [threading.Thread(target=lambda: running.errors.extend(stderr), daemon=True)]
    reading[0].start()
    try:
        said = iter(stdout.readline, "")
        found = next(filter(None, (re.search(r"https?://[^\s#]+", line) for line in said)), None)
        assert found is not None, "".join(running.errors)
        running.address = found[0].removesuffix("/pair")
        reading.append(threading.Thread(target=lambda: running.said.extend(said), daemon=True))
        reading[1].start()
        yield running
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60)
        for thread in reading:
            thread.join(60)
        stdout.close()
        stderr.close()
