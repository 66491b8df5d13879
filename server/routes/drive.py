"""`/ws/drive`: the websocket that carries a client's messages to and from the hub.

Pages without a websocket, and programs that monitor the server, send requests instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from fastapi import APIRouter, WebSocket
from fastapi.responses import JSONResponse
from starlette.requests import Request

from server.gateway.gateway import STOP_PATH
from server.gateway.guard import person_of, role_of
from server.routes.answers import Route
from server.routes.sockets import converse
from server.services import services_of

router = APIRouter(route_class=Route)
STALE_LOOP_S = 2.0
"""Time without a tick after which the control loop counts as stalled, in seconds."""


@dataclass
class StopAnswer:
    """The answer to a STOP. To release this STOP, a client sends its `stop_number`."""

    stop_number: int
    emergency: bool = True


@router.post(STOP_PATH)
async def stop(request: Request) -> StopAnswer:
    """Latch the emergency stop; for a page without a websocket. Every admitted client may do so."""
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
    services = services_of(request)
    state = services.robot.loop.state
    decision = state.decision
    return DoingAnswer(
        robot=services.identity.now.name,
        mode=decision.mode.value,
        driven_by=decision.driven_by.value,
        action=str(decision.action),
        emergency=state.emergency,
        is_full=services.gateway.is_full,
    )


@router.get("/healthz")
async def healthz(request: Request) -> JSONResponse:
    """Answer 200 while the control loop runs, otherwise 503.

    Everybody may send this request, so the answer has no details: the text of a fault may contain,
    for example, the host and path of a camera.
    """
    robot = services_of(request).robot
    is_alive = robot.clock.now_s() - robot.loop.state.now_s < STALE_LOOP_S
    body = {"status": "ok" if is_alive else "loop_stalled"}
    return JSONResponse(body, status_code=200 if is_alive else 503)


@router.websocket("/ws/drive")
async def drive(websocket: WebSocket) -> None:
    """Serve one client until it disconnects."""
    services = services_of(websocket)
    hub, clock = services.hub, services.robot.clock
    await websocket.accept()
    client = hub.join(role_of(websocket), person_of(websocket))

    async def send() -> None:
        while True:
            await websocket.send_text(await client.next_text())
            await clock.pause(0)

    try:
        await converse(
            websocket,
            clock,
            hear=partial(hub.receive, client),
            sending=send(),
            refusals=client.refusals,
            idle_s=services.config.limits.idle_s,
        )
    finally:
        hub.leave(client)
