"""The server starts and ends, whatever its clients do."""

import contextlib
import os
import signal
import socket
import subprocess
import sys

import pytest

from robot.clock import RealClock
from server.hosting.serving import open_socket
from server.hosting.starting_page import StartingPage, StartingPart
from tests.kit.served import served


@pytest.mark.realtime
def test_the_starting_page_names_what_is_starting_and_then_lets_the_server_answer():
    def ask(request: bytes = b"GET / HTTP/1.1\r\n\r\n") -> bytes:
        with socket.create_connection(listener.getsockname()) as line:
            line.sendall(request)
            return b"".join(iter(lambda: line.recv(4096), b""))

    listener = open_socket("127.0.0.1", 0)
    with listener, StartingPage([listener], RealClock()) as page:
        assert ask().startswith(b"HTTP/1.1 503 ")
        assert b"the program" in ask()
        page.part = StartingPart.ROBOT
        assert b"the robot and its camera" in ask()
        page.part = StartingPart.MODEL
        assert b"the robot's model" in ask()
        # a client that leaves causes no delay
        socket.create_connection(listener.getsockname()).close()
        assert b"Retry-After" in ask(b"\x16\x03\x01 no HTTP at all")

        page.stop()

        with socket.create_connection(listener.getsockname()) as line:
            listener.setblocking(True)
            accepted, _ = listener.accept()
            with accepted:
                accepted.sendall(b"served")
                assert line.recv(6) == b"served"


@pytest.mark.slow
@pytest.mark.realtime
def test_a_hanging_upload_and_half_a_request_hold_up_no_end(tmp_path):
    """tests/server/test_keeping.py ends a server with such connections over plain HTTP."""
    words = ("--lan", "--tls", "--host", "127.0.0.1")
    with served(tmp_path / "data", *words) as server, server.unfinished():
        server.process.send_signal(signal.SIGTERM)
        assert server.process.wait(60) == 0
    _check_a_full_pipe_does_not_delay_the_end()
    _check_a_computation_neither_delays_the_end_nor_logs_an_error()


def _check_a_full_pipe_does_not_delay_the_end() -> None:
    """Nobody reads the log's lines, as if the terminal was paused by Ctrl+S."""
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
app.left_turns, serving._END_S = compute, 0.0
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
        port = int(process.stdout.readline())
        with socket.create_connection(("127.0.0.1", port)) as client:
            head = f"POST /api/models/left-turns HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n"
            kind = 'Content-Type: application/json\r\nContent-Length: 12\r\n\r\n{"name":"x"}'
            client.sendall((head + kind).encode())
            assert process.stdout.readline() == b"begun\n"
            process.send_signal(signal.SIGINT)
            assert client.recv(100) == b"", "the server drops the request"
        process.stdin.close()
        errors = process.stderr.read().decode()
        assert process.wait(60) == 0
    assert errors == ""
