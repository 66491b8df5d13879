"""The video, a thin shell around its hub.

`/ws/video` sends frames and receives acknowledgements. `/video.mjpg` is for VLC, dashboards and an
`<img>`: such a stream cannot acknowledge, so the server checks the unread bytes of its connection.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import AsyncGenerator, AsyncIterator, Callable

from fastapi import APIRouter, HTTPException, Request, WebSocket
from fastapi.responses import Response, StreamingResponse

from server.clients.rate_limit import RateLimit
from server.clients.video import Viewer
from server.gateway.guard import person_of
from server.gateway.roles import Refusal, Session
from server.protocol import ErrorCode, ProtocolError, parse_acknowledgement
from server.routes.answers import Route
from server.routes.sockets import converse, fast_path
from server.services import services_of

router = APIRouter(route_class=Route)
_SELDOM_MS = 60_000
_LEAST_ROOM = 2048
"""Number of unread bytes that never count, because a window is known only to the kilobyte."""
_LOOKS = 2000
"""Number of polls, 10 ms each, after which a viewer that seems not to read gets a frame."""
_KEY_EVERY = 32
"""Number of frames between two checks of the key in the address."""
_BOUNDARY, _END_OF_HEADER = b"--frame\r\nContent-Type: image/jpeg\r\n", b"\r\n"
_MEDIA_TYPE = "multipart/x-mixed-replace; boundary=frame"


@router.websocket("/ws/video")
async def video(websocket: WebSocket) -> None:
    """Send the video to one viewer until it disconnects; `?every_ms=N` sets the interval."""
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
                raise ProtocolError(ErrorCode.MALFORMED, "acknowledgements are bytes, not text")
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


@router.get("/video.mjpg", include_in_schema=False)
async def mjpeg(request: Request) -> StreamingResponse:
    """Stream the newest frames until the viewer disconnects, or its key is replaced."""
    hub = services_of(request).hub
    frame = hub.robot.camera.latest()
    if frame is not None:
        hub.video.encoder.encode_jpeg(frame)  # 501 where that needs OpenCV
    gateway, looks = services_of(request).gateway, itertools.count(1)
    sent = itertools.count(1)

    def has_room(n_bytes: int) -> bool:
        """Return True if at most one and a half frames are unread.

        Occasionally a frame is sent anyway, because a system may shrink a connection's window.
        """
        unread = gateway.unread(request.scope)
        return unread <= max(1.5 * n_bytes, _LEAST_ROOM) or next(looks) % _LOOKS == 0

    def is_allowed() -> bool:
        """Return False once the key in the address is no longer valid."""
        is_due = next(sent) % _KEY_EVERY == 0
        return not (is_due and isinstance(gateway.session_by_address(request.scope), Refusal))

    form = _for_browsers if _is_browser(request) else _for_players
    headers = {"x-accel-buffering": "no"}  # by a proxy: it would keep old frames
    if isinstance(gateway.session_by_address(request.scope), Session):
        headers |= {"cross-origin-resource-policy": "cross-origin"}
        headers |= {"access-control-allow-origin": "*"}
    parts = form(hub.video.stream(has_room), is_allowed)
    hub.show_newest()
    return StreamingResponse(parts, media_type=_MEDIA_TYPE, headers=headers)


@router.get("/picture.jpg", include_in_schema=False)
def picture(request: Request) -> Response:
    """Return the newest picture, for networks that pass only plain requests."""
    hub = services_of(request).hub
    frame = hub.robot.camera.latest()
    if frame is None:
        raise HTTPException(503, "The camera has given no picture yet.")
    headers = {"cache-control": "no-store"}
    return Response(hub.video.encoder.encode_jpeg(frame), media_type="image/jpeg", headers=headers)


def _is_browser(request: Request) -> bool:
    """Browsers ask for pages or for pictures; players ask for anything."""
    accept = request.headers.get("accept", "")
    return "sec-fetch-mode" in request.headers or "image/" in accept or "text/html" in accept


async def _for_browsers(
    stream: AsyncGenerator[bytes, None], is_allowed: Callable[[], bool]
) -> AsyncIterator[bytes]:
    """Yield frames, each followed by the next part's header.

    Browsers show a part only when the header of the next one has arrived; sending it with the
    frame saves one frame's time.
    """
    yield _BOUNDARY + _END_OF_HEADER
    async with contextlib.aclosing(stream) as frames:
        async for jpeg in frames:
            yield jpeg + b"\r\n" + _BOUNDARY + _END_OF_HEADER
            if not is_allowed():
                return


async def _for_players(
    stream: AsyncGenerator[bytes, None], is_allowed: Callable[[], bool]
) -> AsyncIterator[bytes]:
    """Yield frames, each with its length: players show it as soon as it is complete.

    Without the length the FFmpeg family looks for the next part's header, and for the one after.
    """
    async with contextlib.aclosing(stream) as frames:
        async for jpeg in frames:
            length = b"Content-Length: %d\r\n" % len(jpeg)
            yield _BOUNDARY + length + _END_OF_HEADER + jpeg + b"\r\n"
            if not is_allowed():
                return
