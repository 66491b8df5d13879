"""`/ws/drive`: messages in both directions. A thin shell around the hub."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from fastapi import APIRouter, Depends, WebSocket
from starlette.requests import Request

from robot.clock import Clock
from server.clients.client import Client
from server.clients.hub import Hub
from server.protocol import ErrorCode, ProtocolError
from server.routes.answers import Route
from server.routes.sockets import close_for_abuse, end_with_either, hear_stop, received
from server.security.guard import STOP_PATH, person_of, require_viewer, role_of
from server.services import services_of

router = APIRouter(route_class=Route)


@router.post(STOP_PATH, dependencies=[Depends(require_viewer)])
async def stop(request: Request) -> dict[str, bool]:
    """Latch the emergency stop, for a page without a websocket. Any admitted client may."""
    services_of(request).hub.emergency.latch("http", role_of(request))
    return {"emergency": True}


@router.websocket("/ws/drive")
async def drive(websocket: WebSocket) -> None:
    """Serve one client until it disconnects."""
    hub = services_of(websocket).hub
    await websocket.accept()
    client = hub.join(role_of(websocket), person_of(websocket))
    stop = partial(hub.emergency.latch, client.id, client.role)
    hear_stop(websocket, stop)
    try:
        await end_with_either(
            _receive(websocket, hub, client, stop), _send(websocket, hub.clock, client)
        )
    finally:
        hub.leave(client)


async def _receive(
    websocket: WebSocket, hub: Hub, client: Client, stop: Callable[[], None]
) -> None:
    limits = hub.config.limits
    async for message in received(websocket, limits.idle_s):
        text = message.get("text")
        if text is None:
            error = ProtocolError(ErrorCode.MALFORMED, "messages are text, not bytes")
            hub.refuse(client, error)
        else:
            hub.receive(client, text)
        if client.refused >= limits.refused_before_closing:
            await close_for_abuse(websocket, stop)
            return


async def _send(websocket: WebSocket, clock: Clock, client: Client) -> None:
    while True:
        text = await client.next_text()
        await websocket.send_text(text)
        await clock.pause(0)
