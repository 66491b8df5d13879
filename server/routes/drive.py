"""`/ws/drive`: messages in both directions, a thin shell around the hub; and STOP by a request."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from fastapi import APIRouter, WebSocket
from starlette.requests import Request

from server.gateway.gateway import STOP_PATH
from server.gateway.guard import person_of, role_of
from server.routes.answers import Route
from server.routes.sockets import converse
from server.services import services_of

router = APIRouter(route_class=Route)


@dataclass
class StopAnswer:
    """The answer to a STOP. A release names this STOP by its number, `stop_number`."""

    stop_number: int
    emergency: bool = True


@router.post(STOP_PATH)
async def stop(request: Request) -> StopAnswer:
    """Latch the emergency stop; for a page without a websocket. Every admitted client may."""
    return StopAnswer(services_of(request).hub.latch_emergency("http", role_of(request)))


@dataclass
class DoingAnswer:
    """What the robot is doing now, for a page without a websocket."""

    robot: str
    mode: str
    driven_by: str
    action: str
    emergency: bool
    is_full: bool
    """True if another websocket would exceed the number of open pages allowed."""


@router.get("/api/state")
def show_doing(request: Request) -> DoingAnswer:
    """Return what the robot is doing now, for pages whose network blocks websockets."""
    hub = services_of(request).hub
    state = hub.robot.loop.state
    decision = state.decision
    return DoingAnswer(
        robot=hub.name,
        mode=decision.mode.value,
        driven_by=decision.driven_by.value,
        action=str(decision.action),
        emergency=state.emergency,
        is_full=services_of(request).gateway.is_full,
    )


@router.websocket("/ws/drive")
async def drive(websocket: WebSocket) -> None:
    """Serve one client until it disconnects."""
    hub = services_of(websocket).hub
    await websocket.accept()
    client = hub.join(role_of(websocket), person_of(websocket))

    async def send() -> None:
        while True:
            await websocket.send_text(await client.next_text())
            await hub.clock.pause(0)

    try:
        await converse(
            websocket,
            hub.clock,
            hear=partial(hub.receive, client),
            sending=send(),
            shut_out=client.shut_out,
            idle_s=hub.config.limits.idle_s,
        )
    finally:
        hub.leave(client)
