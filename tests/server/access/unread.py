"""Measures how much a client has not read yet, by its window; for `test_listener.py`."""

from __future__ import annotations

import socket
import sys

from server.access.listener import _Connection


def check_what_a_client_has_not_read_is_known_though_its_system_has_taken_it() -> None:
    if sys.platform != "linux":
        return  # only Linux reports the size of a window
    listener = socket.create_server(("127.0.0.1", 0))
    client = socket.create_connection(listener.getsockname())
    plain, _ = listener.accept()
    with listener, client, _Connection(fileno=plain.detach()) as connection:
        for _ in range(30):  # its system enlarges the window when the client reads
            connection.sendall(bytes(8000))
            _read(client, 8000)
            connection.unread()
        assert connection.unread() < 1500
        for _ in range(3):
            connection.sendall(bytes(8000))
        assert 20_000 < connection.unread() < 27_000
        _read(client, 24_000)
        connection.sendall(b"x")  # the answer contains the current size of the window
        assert connection.unread() < 1500


def _read(client: socket.socket, n_bytes: int) -> None:
    while n_bytes:
        n_bytes -= len(client.recv(n_bytes))
