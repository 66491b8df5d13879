"""Uvicorn's websocket protocol, over a real pair of sockets."""

from __future__ import annotations

import asyncio
import socket
from typing import Any

import pytest
import uvicorn
from uvicorn.server import ServerState

from server.hosting.uvicorn_fastpath import make_protocol


async def accept_and_wait(scope: Any, receive: Any, send: Any) -> None:
    await receive()
    await send({"type": "websocket.accept"})
    while (await receive())["type"] != "websocket.disconnect":
        pass


@pytest.mark.parametrize("leaves", [True, False])
def test_a_server_ends_in_good_order_while_a_client_leaves(leaves: bool) -> None:
    asyncio.run(end_while_a_client_is_there(leaves))


async def end_while_a_client_is_there(leaves: bool) -> None:
    protocol_type = make_protocol()
    if protocol_type is None:
        pytest.skip("this uvicorn has no fast path")
    from websockets.client import ClientProtocol
    from websockets.uri import parse_uri

    config, state = uvicorn.Config(accept_and_wait), ServerState()
    config.load()
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    loop = asyncio.get_running_loop()
    transport, protocol = await loop.connect_accepted_socket(
        lambda: protocol_type(config=config, server_state=state, app_state={}), ours
    )
    client = ClientProtocol(parse_uri("ws://localhost/"))
    client.send_request(client.connect())
    await loop.sock_sendall(theirs, b"".join(client.data_to_send()))
    client.receive_data(await loop.sock_recv(theirs, 65_536))
    if leaves:
        client.send_close()
        protocol.data_received(b"".join(client.data_to_send()))
    protocol.shutdown()
    while data := await loop.sock_recv(theirs, 65_536):
        client.receive_data(data)
    assert transport.is_closing()
    assert client.close_rcvd is not None
    assert client.close_rcvd.code == (1005 if leaves else 1012)
    theirs.close()
