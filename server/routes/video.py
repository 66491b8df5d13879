"""`/ws/video`: sends frames and receives acknowledgements; the video hub does the work."""

from __future__ import annotations

import asyncio
import contextlib

from fastapi import APIRouter, HTTPException, Request, WebSocket
from fastapi.responses import Response

from server.clients.client import RefusalCounter
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
    services = services_of(websocket)
    broadcast, clock = services.hub.broadcast, services.robot.clock
    await websocket.accept()
    every_ms = websocket.query_params.get("every_ms", "0")
    if not (every_ms.isdecimal() and len(every_ms) <= 5 and int(every_ms) <= _SELDOM_MS):
        await websocket.close(1008, f"every_ms must be a whole number up to {_SELDOM_MS}")
        return
    limits, direct = services.config.limits, fast_path(websocket)
    pace = RateLimit(per_second=limits.frames_per_second, burst=limits.frames_per_second)
    refusals = RefusalCounter(limits.refused_before_closing, services.hub.refused)
    waiting: asyncio.Queue[bytes] = asyncio.Queue()

    async def send_waiting() -> None:
        while True:
            await websocket.send_bytes(await waiting.get())

    def hear(message: str | bytes) -> None:
        """Handle an acknowledgement; any other message is refused and counted."""
        try:
            now_s = clock.now_s()
            if not pace.allows(now_s):
                raise ProtocolError(ErrorCode.TOO_FAST, "too many acknowledgements a second")
            if isinstance(message, str):
                raise ProtocolError(ErrorCode.MALFORMED, "acknowledgements must be bytes")
            broadcast.video.acknowledge(viewer, parse_acknowledgement(message), now_s)
        except ProtocolError as error:
            refusals.note(error)
            if refusals.shut_out.is_set():
                broadcast.video.remove(viewer)

    send = waiting.put_nowait if direct is None else direct.write_now
    viewer = Viewer(send, int(every_ms) / 1000, person_of(websocket))
    broadcast.show_newest()
    broadcast.video.add(viewer)
    try:
        await converse(websocket, clock, hear=hear, sending=send_waiting(), refusals=refusals)
    finally:
        broadcast.video.remove(viewer)


@router.get("/picture.jpg", include_in_schema=False)
async def picture(request: Request) -> Response:
    """Return the newest picture, for pages without a websocket; a resting robot takes a new one."""
    broadcast, shown = services_of(request).hub.broadcast, asyncio.Event()
    with broadcast.video.watched(shown.set):
        broadcast.show_newest()
        if broadcast.video.newest is None:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(shown.wait(), 1.0)
        frame = broadcast.video.newest
    if frame is None:
        raise HTTPException(503, "The camera has not taken a picture yet.")
    jpeg = broadcast.video.encoder.encode_jpeg(frame)
    return Response(jpeg, media_type="image/jpeg", headers={"cache-control": "no-store"})
