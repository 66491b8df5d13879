"""The server ends, whatever its clients leave open; `test_process_faults.py` checks it."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import ssl
import subprocess
import sys
from pathlib import Path

import httpx

from tests.server.own_process import OwnProcess, own_process

UPLOAD = b"PUT /api/models/m/file HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 999\r\n\r\nx"
HALF_A_REQUEST = b"GET / HTTP/1.1\r\nHost: 127.0"


def check_a_hanging_upload_and_half_a_request_hold_up_no_end(tmp_path: Path) -> None:
    with own_process(tmp_path / "data") as running, contextlib.ExitStack() as stack:
        for data in (UPLOAD, HALF_A_REQUEST):
            stack.enter_context(_connected(running)).sendall(data)
        httpx.get(running.address + "/healthz")  # both have been read by then
        running.process.send_signal(signal.SIGTERM)
        assert running.process.wait(60) == 0, "uvicorn alone waits for ever"
    _check_hanging_tls_does_not_delay_the_end(tmp_path / "tls")
    _check_a_full_pipe_does_not_delay_the_end()
    _check_a_computation_neither_delays_the_end_nor_logs_an_error()


def _check_hanging_tls_does_not_delay_the_end(folder: Path) -> None:
    """Silence, half a handshake, half a request and a stalled upload do not delay the end."""
    unchecked = ssl.create_default_context()
    unchecked.check_hostname, unchecked.verify_mode = False, ssl.CERT_NONE
    words = ("--lan", "--tls", "--host", "127.0.0.1")
    with own_process(folder, *words) as running, contextlib.ExitStack() as stack:
        stack.enter_context(_connected(running))
        stack.enter_context(_connected(running)).sendall(b"\x16\x03\x01\x02\x00\x01\x00")
        for data in (b"", HALF_A_REQUEST, UPLOAD):
            plain = stack.enter_context(_connected(running))
            stack.enter_context(unchecked.wrap_socket(plain)).sendall(data)
        httpx.get(running.address + "/healthz", verify=False)
        running.process.send_signal(signal.SIGTERM)
        assert running.process.wait(60) == 0, "a line that nobody ends holds it up"


def _check_a_full_pipe_does_not_delay_the_end() -> None:
    """Like a terminal that is paused by Ctrl+S: nobody reads the log's lines."""
    said = "import logging, server.hosting.logs as logs; logs.start_logging(verbose=False); "
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writing, b"x" * 4096)
    os.set_blocking(writing, True)
    with os.fdopen(reading), os.fdopen(writing, "w") as full:
        words = [sys.executable, "-c", said + "logging.warning('nobody reads this')"]
        assert subprocess.run(words, stderr=full, timeout=60).returncode == 0


COMPUTING = """
import contextlib, sys
from robot.clock import RealClock
from server.board import app, board, class_key, transport
from server.config import Config
from server.hosting import serving
from server.hosting.logs import start_logging

def compute():
    print("begun", flush=True)
    sys.stdin.read()

start_logging(verbose=False)
app.left_turns, serving._END_S = compute, 0.05
there = board.Board(class_key.ClassKey("k" * 40), transport.NetworkTransport(), RealClock())
listener = serving.open_socket("127.0.0.1", 0)
print(listener.getsockname()[1], flush=True)
with contextlib.suppress(KeyboardInterrupt):
    serving.serve(app.create_board_app(Config(), there, RealClock()), [listener])
"""


def _check_a_computation_neither_delays_the_end_nor_logs_an_error() -> None:
    """Press Ctrl-C while the board makes the ready-made lesson on a thread."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [sys.executable, "-c", COMPUTING], stdin=pipe, stdout=pipe, stderr=pipe
    ) as process:
        assert process.stdin and process.stdout and process.stderr
        port = int(process.stdout.readline())
        with socket.create_connection(("127.0.0.1", port)) as client:
            head = f"POST /api/models/left-turns HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n"
            kind = 'Content-Type: application/json\r\nContent-Length: 12\r\n\r\n{"name":"x"}'
            client.sendall((head + kind).encode())
            assert process.stdout.readline() == b"begun\n"
            process.send_signal(signal.SIGINT)
            assert client.recv(100) == b"", "the request is given up"
        process.stdin.close()
        errors = process.stderr.read().decode()
        assert process.wait(60) == 0
    assert errors == ""


def _connected(running: OwnProcess) -> socket.socket:
    return socket.create_connection(("127.0.0.1", running.port))
