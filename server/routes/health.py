"""`/healthz`: says whether the control loop runs."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse

from server.routes.answers import Route
from server.services import services_of

router = APIRouter(route_class=Route)
STALE_LOOP_S = 2.0
"""Time without a tick after which the control loop counts as stalled, in seconds."""


@router.get("/healthz")
async def healthz(request: Request) -> JSONResponse:
    """Answer 200 while the control loop runs, otherwise 503.

    Everybody may send this request, so the answer has no details: the text of a fault may contain,
    for example, the host and path of a camera.
    """
    robot = services_of(request).hub.robot
    is_alive = robot.clock.now_s() - robot.loop.state.now_s < STALE_LOOP_S
    body = {"status": "ok" if is_alive else "loop_stalled"}
    return JSONResponse(body, status_code=200 if is_alive else 503)
