"""The listening socket counts connections, and survives a lack of file descriptors."""

import asyncio
import contextlib
import errno
import json
import socket
import struct
import sys
from collections.abc import Callable
from typing import Any

import pytest

from robot.errors import ConfigurationError
from robot.testing import VirtualClock
from server.access.admission import AdmissionControl
from server.access.config import NetworkLimits
from server.access.listener import AdmissionListener
from server.gateway.roles import Role, Session
from server.hosting.serving import open_socket
from server.integrations.unread import Room, measure_connection
from tests.kit.wait import wait_until


@pytest.mark.parametrize("host", ["\u00fc" * 70, "a" * 64 + ".local", "-", "no host"])
def test_an_invalid_address_to_serve_on_is_named_in_the_error(host):
    with pytest.raises(ConfigurationError, match=f"cannot serve on {host} port 0"):
        open_socket(host, 0)


@pytest.mark.realtime
def test_a_listener_counts_evicts_and_refuses_while_others_are_served():
    listening(a_connection_is_counted_from_accept_to_close)
    listening(an_evicted_connection_is_closed, pending_per_address=1)
    listening(a_reused_port_is_counted_again)
    for number in (errno.EMFILE, errno.ENFILE):
        listening(
            lambda listener, no=number: without_descriptors_the_listener_closes_new_connections(
                listener, no
            )
        )
    listening(a_request_that_has_arrived_is_read_before_its_eviction, pending=40)
    listening(a_stop_goes_first_and_each_person_has_a_share, connections_each=8)
    if sys.platform == "linux":  # only Linux reports the window's size
        the_bytes_that_a_client_has_not_read_are_known()


def listening(scenario: Callable[[AdmissionListener], None], **limits: int) -> None:
    """Run a scenario with a listener, in an event loop; afterwards all connections are closed."""

    def recognise(head: bytes, address: str) -> Session | None:
        return Session(role=Role.VIEWER, name="greedy") if b"cookie: greedy" in head else None

    async def run() -> None:
        admission = AdmissionControl(NetworkLimits(**limits), 500, recognise=recognise)
        listener = AdmissionListener(admission, VirtualClock(), open_socket("127.0.0.1", 0))
        with listener:
            listener.setblocking(False)
            scenario(listener)
            assert (len(admission.connections), admission.pending.taken) == (0, 0)

    asyncio.run(run())


def _connect(listener: AdmissionListener, count: int = 1) -> list[socket.socket]:
    clients = [socket.create_connection(listener.getsockname()) for _ in range(count)]
    for client in clients:
        client.settimeout(60)
    return clients


def _accept_all(listener: AdmissionListener) -> list[socket.socket]:
    accepted = []
    with contextlib.suppress(BlockingIOError):
        while True:
            accepted.append(listener.accept()[0])
    return accepted


def _close(*sockets: socket.socket) -> None:
    for one in sockets:
        one.close()


def a_connection_is_counted_from_accept_to_close(listener: AdmissionListener) -> None:
    (client,) = _connect(listener)
    (connection,) = _accept_all(listener)
    assert len(listener.admission.connections) == 1
    client.sendall(bytes(100_000))
    assert len(connection.recv(262_144)) <= 4096, "one sender must not delay the others"
    assert connection.recv_into(bytearray(262_144)) <= 4096, "TLS has the same limit"
    _close(connection, client)


def an_evicted_connection_is_closed(listener: AdmissionListener) -> None:
    clients = _connect(listener, 2)
    accepted = _accept_all(listener)
    with contextlib.suppress(ConnectionResetError):
        assert clients[0].recv(1) == b""
    assert len(accepted) == 2 and listener.admission.pending.evicted == 1
    _close(*clients, *accepted)


def a_reused_port_is_counted_again(listener: AdmissionListener) -> None:
    """The late end of an earlier connection must not free the current connection's slot."""
    admission, port = listener.admission, 0
    held = []
    for _ in range(3):
        with socket.socket() as client:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            client.bind(("127.0.0.1", port))
            client.connect(listener.getsockname())
            port = client.getsockname()[1]
            held += _accept_all(listener)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    assert len(held) == 3
    for connection in held[:-1]:
        connection.close()
        assert (len(admission.connections), admission.pending.taken) == (1, 1)
    held[-1].close()


def without_descriptors_the_listener_closes_new_connections(
    listener: AdmissionListener, number: int
) -> None:
    """The listener does not loop forever, either."""
    real, failures = socket.socket.accept, iter([True, False, True, False])

    def failing(self: socket.socket) -> Any:
        if next(failures, False):
            raise OSError(number, "too many")
        return real(self)

    clients = _connect(listener, 2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(socket.socket, "accept", failing)
        assert _accept_all(listener) == []
    for client in clients:
        assert client.recv(1) == b"", "the connection was closed, not left waiting"
    _close(*clients)


def a_request_that_has_arrived_is_read_before_its_eviction(listener: AdmissionListener) -> None:
    clients, rounds = _connect(listener, 100), []
    for _ in range(9):
        listener.clock.advance(1.0)  # a busy computer needs this time
        rounds.append(_accept_all(listener))
    assert [len(accepted) for accepted in rounds] == [40, *7 * [0], 40]
    assert listener.admission.pending.evicted == 40
    _close(*clients, *rounds[0], *rounds[-1])


def a_stop_goes_first_and_each_person_has_a_share(listener: AdmissionListener) -> None:
    clients = _connect(listener, 51)
    for client in clients[:40]:
        client.sendall(b"GET / HTTP/1.1\r\ncookie: greedy\r\n\r\n")
    for client in clients[40:50]:
        client.sendall(b"GET / HTTP/1.1\r\n\r\n")
    clients[50].sendall(b"POST /api/stop HTTP/1.1\r\ncookie: greedy\r\n\r\n")
    accepted = _accept_all(listener)
    assert accepted[0].recv(20).startswith(b"POST /api/stop"), "a STOP goes first, whoever sends it"
    assert len(accepted) == 1 + 8 + 10, "each person gets at most eight at a time"
    refused = []
    for client in clients[:40]:
        client.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            refused.append(client.recv(4096))
    assert len(refused) == 32, "each refused client gets an answer instead of a reset"
    for told in refused:
        head, body = told.split(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 429 ") and b"\r\nRetry-After: 1\r\n" in head
        assert head.endswith(f"Content-Length: {len(body)}".encode()) and json.loads(body)
    _close(*clients, *accepted)


def the_bytes_that_a_client_has_not_read_are_known() -> None:
    listener, client = socket.create_server(("127.0.0.1", 0)), socket.socket()
    # until the viewer's window stops growing
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65_536)
    client.connect(listener.getsockname())
    connection, peer = listener.accept()
    measure = measure_connection(peer)
    room = Room(measure)

    def read(n_bytes: int) -> None:
        while n_bytes:
            n_bytes -= len(client.recv(n_bytes))

    with listener, client, connection:
        widest, same = 0, 0
        while same < 30:  # the client's system enlarges the window as the client reads
            connection.sendall(bytes(8000))
            read(8000)
            room.is_there(8000)
            measured = measure()
            widest, same = (measured[1], 0) if measured[1] > widest else (widest, same + 1)
        sent = 0
        while room.is_there(8000):
            connection.sendall(bytes(8000))
            sent += 1
            assert sent < 5, "sent data reduces the room"
        read(8000 * sent)
        # the client's acknowledgement, which may be delayed, contains the window's size
        connection.sendall(b"x")
        wait_until(lambda: room.is_there(1))
    assert Room(measure_connection(peer)).is_there(1), "without a measurement, there is room"
