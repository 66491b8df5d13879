"""`/ws/video`: sends frames and receives acknowledgements, a thin shell around the hub."""

from __future__ import annotations

import asyncio
import itertools

from fastapi import APIRouter, HTTPException, Request, WebSocket
from fastapi.responses import Response

from server.clients.rate_limit import RateLimit
from server.clients.video import Viewer
from server.gateway.guard import person_of
from server.protocol import ErrorCode, ProtocolError, parse_acknowledgement
from server.routes.answers import Route
from server.routes.sockets import converse, fast_path
from server.services import services_of

router = APIRouter(route_class=Route)
_SELDOM_MS = 60_000


@router.websocket("/ws/video")
async def video(websocket: WebSocket) -> None:
    """Send the video to one viewer until it disconnects, at most one frame every `every_ms`."""
    hub = services_of(websocket).hub
    await websocket.accept()
    every_ms = websocket.query_params.get("every_ms", "0")
    if not (every_ms.isdecimal() and len(every_ms) <= 5 and int(every_ms) <= _SELDOM_MS):
        await websocket.close(1008, f"every_ms must be a whole number up to {_SELDOM_MS}")
        return
    limits, direct = hub.config.limits, fast_path(websocket)
    pace = RateLimit(per_second=limits.frames_per_second, burst=limits.frames_per_second)
    refused, shut_out = itertools.count(1), asyncio.Event()
    waiting: asyncio.Queue[bytes] = asyncio.Queue()

    async def send_waiting() -> None:
        while True:
            await websocket.send_bytes(await waiting.get())

    def hear(message: str | bytes) -> None:
        """Handle an acknowledgement; any other message is refused and counted."""
        try:
            now_s = hub.clock.now_s()
            if not pace.allows(now_s):
                raise ProtocolError(ErrorCode.TOO_FAST, "too many acknowledgements a second")
            if isinstance(message, str):
                raise ProtocolError(ErrorCode.MALFORMED, "acknowledgements must be bytes")
            hub.video.acknowledge(viewer, parse_acknowledgement(message), now_s)
        except ProtocolError as error:
            hub.refused[error.code] += 1
            if next(refused) == limits.refused_before_closing:
                hub.video.remove(viewer)
                shut_out.set()

    send = waiting.put_nowait if direct is None else direct.write_now
    viewer = Viewer(send, int(every_ms) / 1000, person_of(websocket))
    hub.show_newest()
    hub.video.add(viewer)
    try:
        await converse(websocket, hub.clock, hear=hear, sending=send_waiting(), shut_out=shut_out)
    finally:
        hub.video.remove(viewer)


@router.get("/picture.jpg", include_in_schema=False)
def picture(request: Request) -> Response:
    """Return the newest picture, for pages whose network blocks websockets."""
    hub = services_of(request).hub
    frame = hub.robot.camera.latest()
    if frame is None:
        raise HTTPException(503, "The camera has given no picture yet.")
    headers = {"cache-control": "no-store"}
    return Response(hub.video.encoder.encode_jpeg(frame), media_type="image/jpeg", headers=headers)
