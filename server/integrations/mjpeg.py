"""`/video.mjpg`: the video for VLC, dashboards and an `<img>`.

A viewer of this stream cannot acknowledge frames. Instead, the server measures how many bytes of
its connection are still unread.
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
from server.integrations.unread import Room, measure_connection
from server.routes.answers import Route
from server.services import services_of

router = APIRouter(route_class=Route)
_VLC_WAITS_FOR, _VLC_ADDS = 15 * 1024, 5 * 1024
"""VLC 3 first looks for the end of a picture after `_VLC_WAITS_FOR` bytes, and then again after
every further `_VLC_ADDS` bytes. VLC ignores the length in a part's header."""
_VLC_END = 12
"""Number of bytes after a picture's end that VLC must have received when it looks for the end.
These bytes are the beginning of the next boundary; bytes of the next picture must not be among
them."""
_KEY_EVERY = 32
"""Number of frames after which the key in the viewer's address is checked again."""
_ROOM_EVERY_S = 0.01
"""Interval at which the unread bytes of a slow viewer are measured, in seconds."""
_BOUNDARY, _END_OF_HEADER = b"--frame\r\nContent-Type: image/jpeg\r\n", b"\r\n"
_MEDIA_TYPE = "multipart/x-mixed-replace; boundary=frame"


@router.get("/video.mjpg", include_in_schema=False)
async def mjpeg(request: Request) -> StreamingResponse:
    """Stream the newest frames until the viewer disconnects or its key is replaced."""
    services = services_of(request)
    broadcast, gateway = services.hub.broadcast, services.gateway
    frame = services.robot.camera.latest()
    if frame is not None:
        # encode now: once the stream has begun, it is too late for a 501 if OpenCV is missing
        broadcast.video.encoder.encode_jpeg(frame)
    sent, room = itertools.count(1), Room(measure_connection(gateway.peer(request.scope)))

    def is_allowed() -> bool:
        """Return False once the key in the address is no longer valid."""
        is_due = next(sent) % _KEY_EVERY == 0
        return not (is_due and isinstance(gateway.session_by_address(request.scope), Refusal))

    headers = {"x-accel-buffering": "no"}  # a proxy that buffered would delay the frames
    if isinstance(gateway.session_by_address(request.scope), Session):
        headers["cross-origin-resource-policy"] = "cross-origin"
        headers["access-control-allow-origin"] = "*"
    stream = frames_of(broadcast.video, services.robot.clock, room.is_there)
    if "VLC/" in request.headers.get("user-agent", ""):
        parts = _parts_that_end_at_once(_padded_for_vlc(stream), is_allowed)
    elif _is_browser(request):
        parts = _parts_that_end_at_once(stream, is_allowed)
    else:
        parts = _parts_with_length(stream, is_allowed)
    broadcast.show_newest()
    return StreamingResponse(parts, media_type=_MEDIA_TYPE, headers=headers)


async def frames_of(
    video: VideoHub, clock: Clock, has_room: Callable[[int], bool]
) -> AsyncGenerator[bytes, None]:
    """Yield the newest frames as JPEG, for viewers that cannot acknowledge.

    `has_room` gets the size of the last frame, and returns True if the viewer has read it. A viewer
    that reads slowly misses frames, and then gets the newest.
    """
    shown, last_id, n_bytes = asyncio.Event(), 0, 0
    with video.watched(shown.set):
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


def _is_browser(request: Request) -> bool:
    """True if the headers are those of a browser; other programs send no such headers."""
    accept = request.headers.get("accept", "")
    return "sec-fetch-mode" in request.headers or "image/" in accept or "text/html" in accept


async def _parts_with_length(
    stream: AsyncGenerator[bytes, None], is_allowed: Callable[[], bool]
) -> AsyncIterator[bytes]:
    """Yield the parts of the MJPEG stream for a media player.

    Each part states its length. Without the length, players based on FFmpeg would show a part only
    after the headers of the next two parts.
    """
    async with contextlib.aclosing(stream) as frames:
        async for jpeg in frames:
            length = b"Content-Length: %d\r\n" % len(jpeg)
            yield _BOUNDARY + length + _END_OF_HEADER + jpeg + b"\r\n"
            if not is_allowed():
                return


async def _parts_that_end_at_once(
    stream: AsyncGenerator[bytes, None], is_allowed: Callable[[], bool]
) -> AsyncIterator[bytes]:
    """Yield the parts of the answer for browsers.

    A browser shows a part only after the header of the next part, so each frame is sent together
    with the next header.
    """
    yield _BOUNDARY + _END_OF_HEADER
    async with contextlib.aclosing(stream) as frames:
        async for jpeg in frames:
            yield jpeg + b"\r\n" + _BOUNDARY + _END_OF_HEADER
            if not is_allowed():
                return


async def _padded_for_vlc(stream: AsyncGenerator[bytes, None]) -> AsyncGenerator[bytes, None]:
    """Yield each frame, padded with zeros, so that VLC shows it without waiting for the next."""
    waits_for = _VLC_WAITS_FOR
    async with contextlib.aclosing(stream) as frames:
        async for jpeg in frames:
            while len(jpeg) + _VLC_END > waits_for:
                waits_for += _VLC_ADDS
            yield jpeg.ljust(waits_for - _VLC_END, b"\0")
