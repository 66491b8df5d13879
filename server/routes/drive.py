"""`/ws/drive`: messages in both directions. A thin shell around the hub."""

from __future__ import annotations

from functools import partial

from fastapi import APIRouter, WebSocket
from starlette.requests import Request

from server.protocol import ErrorCode, ProtocolError
from server.routes.answers import Route
from server.routes.sockets import converse
from server.security.guard import STOP_PATH, person_of, role_of
from server.services import services_of

router = APIRouter(route_class=Route)


@router.post(STOP_PATH)
async def stop(request: Request) -> dict[str, bool]:
    """Latch the emergency stop, for a page without a websocket. Any admitted client may."""
    services_of(request).hub.latch_emergency("http", role_of(request))
    return {"emergency": True}


@router.websocket("/ws/drive")
async def drive(websocket: WebSocket) -> None:
    """Serve one client until it disconnects."""
    hub = services_of(websocket).hub
    await websocket.accept()
    client = hub.join(role_of(websocket), person_of(websocket))

    async def refuse_bytes(_: bytes) -> None:
        hub.refuse(client, ProtocolError(ErrorCode.MALFORMED, "messages are text, not bytes"))

    async def send() -> None:
        while True:
            await websocket.send_text(await client.next_text())
            await hub.clock.pause(0)

    try:
        await converse(
            websocket,
            hub.clock,
            idle_s=hub.config.limits.idle_s,
            on_text=partial(hub.receive, client),
            on_bytes=refuse_bytes,
            sending=send(),
            shut_out=client.shut_out,
        )
    finally:
        hub.leave(client)
