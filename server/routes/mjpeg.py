"""`/video.mjpg`: the video for VLC, dashboards and an `<img>`; the page itself does not use it.

A stream cannot acknowledge, so behind a slow link it lags; `/ws/video` does not.
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator

from fastapi import APIRouter, Request
from fastapi.responses import StreamingResponse

from server.clients.hub import Hub
from server.routes.answers import Route
from server.services import services_of

router = APIRouter(route_class=Route)
_BOUNDARY = b"--frame\r\nContent-Type: image/jpeg\r\n\r\n"
_MEDIA_TYPE = "multipart/x-mixed-replace; boundary=frame"


@router.get("/video.mjpg", include_in_schema=False)
async def mjpeg(request: Request) -> StreamingResponse:
    """Stream the newest frames until the viewer disconnects."""
    hub = services_of(request).hub
    frame = hub.robot.camera.latest()
    if frame is not None:
        hub.video.encoder.encode_jpeg(frame)  # 501 where that needs OpenCV
    return StreamingResponse(_parts(hub), media_type=_MEDIA_TYPE)


async def _parts(hub: Hub) -> AsyncIterator[bytes]:
    """Yield frames, each with the next part's header behind it.

    Browsers show a part only when the header of the next one has arrived; sending it with the
    frame saves one frame's time.
    """
    yield _BOUNDARY
    hub.show_newest()
    async with contextlib.aclosing(hub.video.stream()) as frames:
        async for jpeg in frames:
            yield jpeg + b"\r\n" + _BOUNDARY
