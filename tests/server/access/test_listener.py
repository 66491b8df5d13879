"""The listening socket: counting, back-off, and its behaviour without free descriptors."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import itertools
import json
import socket
import struct
from typing import Any

import pytest

from robot.errors import ConfigurationError
from robot.testing import VirtualClock
from server.access.admission import AdmissionControl
from server.access.config import NetworkLimits
from server.access.listener import AdmissionListener
from server.gateway.roles import Role, Session
from server.hosting.serving import open_socket

from .unread import check_what_a_client_has_not_read_is_known_though_its_system_has_taken_it


def _listener(admission: AdmissionControl) -> AdmissionListener:
    listener = AdmissionListener(admission, VirtualClock(), open_socket("127.0.0.1", 0))
    listener.setblocking(False)
    return listener


async def _accept_all(listener: AdmissionListener) -> list[socket.socket]:
    accepted = []
    while True:
        try:
            accepted.append(listener.accept()[0])
        except BlockingIOError:
            return accepted


@pytest.mark.parametrize("host", ["\u00fc" * 70, "a" * 64 + ".local", "", "-", "no host"])
def test_an_invalid_address_to_serve_on_is_named_in_the_error(host: str) -> None:
    try:
        open_socket(host, 0).close()
    except ConfigurationError as error:
        assert f"cannot serve on {host} port 0" in str(error)
    else:
        assert host == "", "which is every address of this computer"


@pytest.mark.realtime
def test_a_listener_counts_evicts_and_refuses_while_others_are_served(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    a_connection_is_counted_from_accept_to_close()
    an_evicted_connection_sees_the_end()
    a_reused_port_is_counted_again()
    for number in (errno.EMFILE, errno.ENFILE):
        without_descriptors_it_turns_away_and_does_not_spin(number, monkeypatch)
    what_has_come_is_read_before_it_is_pushed_out()
    of_all_that_wait_a_stop_is_handed_on_first_and_of_one_person_a_share()
    check_what_a_client_has_not_read_is_known_though_its_system_has_taken_it()


def a_connection_is_counted_from_accept_to_close() -> None:
    admission = AdmissionControl(NetworkLimits(), 10)

    async def scenario() -> None:
        listener = _listener(admission)
        with socket.create_connection(listener.getsockname()) as client:
            (connection,) = await _accept_all(listener)
            assert len(admission.connections) == 1
            client.sendall(bytes(100_000))
            assert len(connection.recv(262_144)) <= 4096, "who sends much leaves time to others"
            assert connection.recv_into(bytearray(262_144)) <= 4096, "over TLS, too"
            connection.close()
            assert len(admission.connections) == 0
        listener.close()

    asyncio.run(scenario())


def an_evicted_connection_sees_the_end() -> None:
    admission = AdmissionControl(NetworkLimits(pending_per_address=1), 10)

    async def scenario() -> None:
        listener = _listener(admission)
        address = listener.getsockname()
        with socket.create_connection(address) as first, socket.create_connection(address):
            accepted = await _accept_all(listener)
            first.settimeout(60)
            try:
                end = first.recv(1)
            except ConnectionResetError:
                end = b""
            for connection in accepted:
                connection.close()
        listener.close()
        assert (
            len(accepted) == 2
            and end == b""
            and admission.pending.evicted == 1
            and len(admission.connections) == 0
        )

    asyncio.run(scenario())


def a_reused_port_is_counted_again() -> None:
    """The previous connection is closed late; that must not free the current connection's slot."""
    admission = AdmissionControl(NetworkLimits(), 10)

    async def scenario() -> None:
        listener = _listener(admission)
        port = 0
        held = []
        for _ in range(3):
            with socket.socket() as client:
                client.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                client.bind(("127.0.0.1", port))
                client.connect(listener.getsockname())
                port = client.getsockname()[1]
                held += await _accept_all(listener)
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        assert len(held) == 3
        for connection in held[:-1]:
            connection.close()
            assert (len(admission.connections), admission.pending.taken) == (1, 1)
        held[-1].close()
        assert (len(admission.connections), admission.pending.taken) == (0, 0)
        listener.close()

    asyncio.run(scenario())


def without_descriptors_it_turns_away_and_does_not_spin(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    admission = AdmissionControl(NetworkLimits(), 10)
    real = socket.socket.accept
    failures = iter([True, False, True, False])

    def failing(self: socket.socket) -> Any:
        if next(failures, False):
            raise OSError(number, "too many")
        return real(self)

    async def scenario() -> None:
        listener = _listener(admission)
        address = listener.getsockname()
        with socket.create_connection(address) as one, socket.create_connection(address) as two:
            monkeypatch.setattr(socket.socket, "accept", failing)
            assert await _accept_all(listener) == []
            monkeypatch.undo()
            for client in (one, two):
                client.settimeout(60)
                assert client.recv(1) == b"", "it was turned away, not left waiting"
        listener.close()

    asyncio.run(scenario())


def what_has_come_is_read_before_it_is_pushed_out() -> None:
    admission = AdmissionControl(NetworkLimits(pending=40), 500)

    async def scenario() -> None:
        listener = _listener(admission)
        clients = [socket.create_connection(listener.getsockname()) for _ in range(100)]
        assert isinstance(listener.clock, VirtualClock)
        rounds = []
        for _ in range(9):
            listener.clock.advance(1.0)  # of a busy computer
            rounds.append(await _accept_all(listener))
        for one in itertools.chain(clients, *rounds):
            one.close()
        listener.close()
        assert [len(accepted) for accepted in rounds] == [40, *7 * [0], 40]
        assert len(admission.connections) == 0 and admission.pending.evicted == 40

    asyncio.run(scenario())


def of_all_that_wait_a_stop_is_handed_on_first_and_of_one_person_a_share() -> None:
    def recognise(head: bytes, address: str) -> Session | None:
        return Session(role=Role.VIEWER, name="greedy") if b"cookie: greedy" in head else None

    limits = NetworkLimits(connections_each=8)
    admission = AdmissionControl(limits, 500, recognise=recognise)

    async def scenario() -> None:
        listener = _listener(admission)
        clients = [socket.create_connection(listener.getsockname()) for _ in range(51)]
        for client in clients[:40]:
            client.sendall(b"GET / HTTP/1.1\r\ncookie: greedy\r\n\r\n")
        for client in clients[40:50]:
            client.sendall(b"GET / HTTP/1.1\r\n\r\n")
        clients[50].sendall(b"POST /api/stop HTTP/1.1\r\ncookie: greedy\r\n\r\n")
        accepted = await _accept_all(listener)
        assert accepted[0].recv(20).startswith(b"POST /api/stop"), "whoever sends it, it goes first"
        assert len(accepted) == 1 + 8 + 10, "the others of that person cost nothing more"
        refused = []
        for client in clients[:40]:
            client.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                refused.append(client.recv(4096))
        assert len(refused) == 32, "none is reset"
        for told in refused:
            head, body = told.split(b"\r\n\r\n")
            assert head.startswith(b"HTTP/1.1 429 ") and b"\r\nRetry-After: 1\r\n" in head
            assert head.endswith(f"Content-Length: {len(body)}".encode()) and json.loads(body)
        for one in itertools.chain(clients, accepted):
            one.close()
        listener.close()
        assert len(admission.connections) == 0

    asyncio.run(scenario())
