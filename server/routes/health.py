"""`/healthz` and `/metrics`: for monitoring."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, PlainTextResponse, Response

from server.clients.metrics import CONTENT_TYPE, Measured, render
from server.routes.answers import Route
from server.services import services_of

router = APIRouter(route_class=Route)
STALE_LOOP_S = 2.0
"""A control loop without a tick for so long has stalled."""


@router.get("/healthz")
async def healthz(request: Request) -> JSONResponse:
    """Answer 200 while the control loop runs, otherwise 503."""
    hub = services_of(request).hub
    state = hub.robot.loop.state
    is_alive = hub.robot.clock.now_s() - state.now_s < STALE_LOOP_S
    body = {
        "status": "ok" if is_alive else "loop_stalled",
        "mode": state.decision.mode.value,
        "fault": state.fault,
    }
    return JSONResponse(body, status_code=200 if is_alive else 503)


@router.get("/metrics", response_class=PlainTextResponse)
async def metrics(request: Request) -> Response:
    """Return the measurements for Prometheus."""
    hub = services_of(request).hub
    video = hub.video
    measured = Measured(
        state=hub.robot.loop.state,
        now_s=hub.robot.clock.now_s(),
        clients=len(hub.clients),
        viewers=video.viewers,
        frames_sent=video.frames_sent,
        frames_encoded=video.frames_encoded,
        frame_ages=video.frame_ages,
        refused=hub.refused,
        turned_away=services_of(request).turned_away,
    )
    return Response(render(measured), media_type=CONTENT_TYPE)
