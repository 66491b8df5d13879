"""The server ends, whatever its clients leave hanging; `test_process_faults.py` checks it."""

from __future__ import annotations

import contextlib
import signal
import socket
from pathlib import Path

import httpx

from tests.server.own_process import own_process

UPLOAD = b"PUT /api/models/m/file HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 999\r\n\r\nx"
HALF_A_REQUEST = b"GET / HTTP/1.1\r\nHost: 127.0"


def check_a_hanging_upload_and_half_a_request_hold_up_no_end(tmp_path: Path) -> None:
    with own_process(tmp_path / "data") as running, contextlib.ExitStack() as stack:
        for data in (UPLOAD, HALF_A_REQUEST):
            client = stack.enter_context(socket.create_connection(("127.0.0.1", running.port)))
            client.sendall(data)
        httpx.get(running.address + "/healthz")  # both have been read by then
        running.process.send_signal(signal.SIGTERM)
        assert running.process.wait(60) == 0, "uvicorn alone waits for ever"
