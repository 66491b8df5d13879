"""`/video.mjpg`: the video for VLC, dashboards and an `<img>`.

A viewer of such a stream cannot acknowledge frames, so the server checks the unread bytes of its
connection.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import AsyncGenerator, AsyncIterator, Callable

from fastapi import APIRouter, Request
from fastapi.responses import StreamingResponse

from robot.clock import Clock
from server.clients.video import VideoHub
from server.gateway.roles import Refusal, Session
from server.routes.answers import Route
from server.services import services_of

router = APIRouter(route_class=Route)
_LEAST_ROOM = 2048
"""Number of unread bytes that are ignored, because windows are reported in steps of kilobytes."""
_LOOKS = 2000
"""Number of polls, 10 ms each, after which a viewer that seems not to read gets a frame."""
_KEY_EVERY = 32
"""Number of frames between two checks of the key in the address."""
_ROOM_EVERY_S = 0.01
"""Interval at which a viewer is polled for unread bytes, in seconds."""
_BOUNDARY, _END_OF_HEADER = b"--frame\r\nContent-Type: image/jpeg\r\n", b"\r\n"
_MEDIA_TYPE = "multipart/x-mixed-replace; boundary=frame"


@router.get("/video.mjpg", include_in_schema=False)
async def mjpeg(request: Request) -> StreamingResponse:
    """Stream the newest frames until the viewer disconnects or its key is replaced."""
    hub = services_of(request).hub
    frame = hub.robot.camera.latest()
    if frame is not None:
        hub.video.encoder.encode_jpeg(frame)  # answers 501 if this needs OpenCV
    gateway, looks = services_of(request).gateway, itertools.count(1)
    sent = itertools.count(1)

    def has_room(n_bytes: int) -> bool:
        """Return True if at most one and a half frames are unread.

        Occasionally a frame is sent anyway, because a system may shrink a window without unread
        bytes.
        """
        unread = gateway.unread(request.scope)
        return unread <= max(1.5 * n_bytes, _LEAST_ROOM) or next(looks) % _LOOKS == 0

    def is_allowed() -> bool:
        """Return False once the key in the address is no longer valid."""
        is_due = next(sent) % _KEY_EVERY == 0
        return not (is_due and isinstance(gateway.session_by_address(request.scope), Refusal))

    headers = {"x-accel-buffering": "no"}  # a buffering proxy would keep old frames
    if isinstance(gateway.session_by_address(request.scope), Session):
        headers["cross-origin-resource-policy"] = "cross-origin"
        headers["access-control-allow-origin"] = "*"
    stream = frames_of(hub.video, hub.clock, has_room)
    parts = _parts(stream, is_allowed, for_browser=_is_browser(request))
    hub.show_newest()
    return StreamingResponse(parts, media_type=_MEDIA_TYPE, headers=headers)


async def frames_of(
    video: VideoHub, clock: Clock, has_room: Callable[[int], bool]
) -> AsyncGenerator[bytes, None]:
    """Yield the newest frames as JPEG, for viewers that cannot acknowledge.

    `has_room` decides from the last frame's size whether another may be sent. A viewer that does
    not read skips frames, and gets the newest as soon as it reads again.
    """
    shown, last_id, n_bytes = asyncio.Event(), 0, 0
    end = video.watch(shown.set)
    try:
        while True:
            frame = video.newest
            if frame is None or frame.frame_id == last_id:
                shown.clear()
                await shown.wait()
            elif not has_room(n_bytes):
                await clock.pause(_ROOM_EVERY_S)
            else:
                last_id, jpeg = frame.frame_id, video.encoder.encode_jpeg(frame)
                video.frames_sent += 1
                n_bytes = len(jpeg)
                yield jpeg
    finally:
        end()


def _is_browser(request: Request) -> bool:
    """True for a browser, which accepts pages or pictures; players accept anything."""
    accept = request.headers.get("accept", "")
    return "sec-fetch-mode" in request.headers or "image/" in accept or "text/html" in accept


async def _parts(
    stream: AsyncGenerator[bytes, None], is_allowed: Callable[[], bool], *, for_browser: bool
) -> AsyncIterator[bytes]:
    """Yield the parts of the answer, each as soon as its client can show it.

    Browsers show a part only when the next part's header has arrived, so that header is sent with
    the frame. Players based on FFmpeg wait for the headers of the next two parts, unless a part
    says its length.
    """
    if for_browser:
        yield _BOUNDARY + _END_OF_HEADER
    async with contextlib.aclosing(stream) as frames:
        async for jpeg in frames:
            if for_browser:
                yield jpeg + b"\r\n" + _BOUNDARY + _END_OF_HEADER
            else:
                length = b"Content-Length: %d\r\n" % len(jpeg)
                yield _BOUNDARY + length + _END_OF_HEADER + jpeg + b"\r\n"
            if not is_allowed():
                return
