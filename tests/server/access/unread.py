"""Measures what a client has not read yet, by its window; for `test_listener.py`."""

from __future__ import annotations

import socket
import sys

from server.integrations.unread import Room, measure_connection
from tests.kit.wait import wait_until


def check_what_a_client_has_not_read_is_known_though_its_system_has_taken_it() -> None:
    if sys.platform != "linux":
        return  # only Linux reports the size of a window
    listener, client = socket.create_server(("127.0.0.1", 0)), socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65_536)  # its window stops growing
    client.connect(listener.getsockname())
    connection, peer = listener.accept()
    measure = measure_connection(peer)
    room = Room(measure)
    with listener, client, connection:
        widest, same = 0, 0
        while same < 30:  # the client's system enlarges the window as the client reads
            connection.sendall(bytes(8000))
            _read(client, 8000)
            room.is_there(8000)
            measured = measure()
            assert measured is not None
            widest, same = (measured[1], 0) if measured[1] > widest else (widest, same + 1)
        sent = 0
        while room.is_there(8000):
            connection.sendall(bytes(8000))
            sent += 1
            assert sent < 5, "they are not counted"
        _read(client, 8000 * sent)
        connection.sendall(b"x")  # its acknowledgement, which may be delayed, has the window's size
        wait_until(lambda: room.is_there(1))
    assert Room(measure_connection(peer)).is_there(1), "nothing is known of a closed connection"


def _read(client: socket.socket, n_bytes: int) -> None:
    while n_bytes:
        n_bytes -= len(client.recv(n_bytes))
