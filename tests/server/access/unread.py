"""Measures what a client has not read yet, by its window; for `test_listener.py`."""

from __future__ import annotations

import socket
import sys

from server.integrations.unread import Room, measure_connection


def check_what_a_client_has_not_read_is_known_though_its_system_has_taken_it() -> None:
    if sys.platform != "linux":
        return  # only Linux reports the size of a window
    listener = socket.create_server(("127.0.0.1", 0))
    client = socket.create_connection(listener.getsockname())
    connection, peer = listener.accept()
    room = Room(measure_connection(peer))
    with listener, client, connection:
        for _ in range(30):  # its system enlarges the window when the client reads
            connection.sendall(bytes(8000))
            _read(client, 8000)
            room.is_there(8000)
        sent = 0
        while room.is_there(8000):
            connection.sendall(bytes(8000))
            sent += 1
            assert sent < 5, "they are not counted"
        _read(client, 8000 * sent)
        connection.sendall(b"x")  # the answer contains the current size of the window
        assert room.is_there(1)
    assert Room(measure_connection(peer)).is_there(1), "nothing is known of a closed connection"


def _read(client: socket.socket, n_bytes: int) -> None:
    while n_bytes:
        n_bytes -= len(client.recv(n_bytes))
