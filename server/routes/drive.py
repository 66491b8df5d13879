"""`/ws/drive`: messages in both directions. A thin shell around the hub."""

from __future__ import annotations

from fastapi import APIRouter, WebSocket
from starlette.requests import Request

from server.protocol import ErrorCode, ProtocolError
from server.routes.answers import Route
from server.routes.sockets import end_with_either, hear_at_once, received, show_out
from server.security.guard import STOP_PATH, note_use, person_of, role_of
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
    limits, clock = hub.config.limits, hub.clock
    await websocket.accept()
    client = hub.join(role_of(websocket), person_of(websocket))

    def hear(text: str) -> None:
        note_use(websocket.scope, clock.now_s())
        hub.receive(client, text)

    async def receive() -> None:
        def is_idle() -> bool:
            return clock.now_s() - client.last_message_s >= limits.idle_s

        async for message in received(websocket, limits.idle_s, is_idle):
            text = message.get("text")
            if text is not None:
                hear(text)
            else:
                error = ProtocolError(ErrorCode.MALFORMED, "messages are text, not bytes")
                hub.refuse(client, error)

    async def send() -> None:
        while True:
            text = await client.next_text()
            await websocket.send_text(text)
            await clock.pause(0)

    hear_at_once(websocket, hear)
    try:
        await end_with_either(receive(), send(), show_out(websocket, clock, client.shut_out))
    finally:
        hub.leave(client)
