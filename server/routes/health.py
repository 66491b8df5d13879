"""`/healthz`: is the robot's loop alive? For supervisors and load tests."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse

from server.station import Station

router = APIRouter()
STALE_LOOP_S = 2.0
"""A loop that has not turned for so long is not alive."""


@router.get("/healthz")
async def healthz(request: Request) -> JSONResponse:
    """Answer 200 while the control loop turns, else 503."""
    station: Station = request.app.state.station
    state = station.robot.loop.state
    is_alive = station.robot.clock.now_s() - state.now_s < STALE_LOOP_S
    body = {
        "status": "ok" if is_alive else "loop_stalled",
        "mode": state.decision.mode.value,
        "fault": state.fault,
    }
    return JSONResponse(body, status_code=200 if is_alive else 503)
