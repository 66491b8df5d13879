"""The video, a thin shell around its hub.

`/ws/video` sends frames and receives acknowledgements. `/video.mjpg` is for VLC, dashboards and an
`<img>`: such a stream cannot acknowledge, so behind a slow link it lags.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from fastapi import APIRouter, Request, WebSocket
from fastapi.responses import StreamingResponse

from server.clients.hub import Hub
from server.clients.video import EncodedFrame, Viewer
from server.protocol import ErrorCode, ProtocolError, parse_acknowledgement
from server.routes.answers import Route
from server.routes.sockets import converse, fast_path
from server.security.guard import person_of
from server.security.pace import Pace
from server.services import services_of

router = APIRouter(route_class=Route)
_SELDOM_MS = 60_000
_BOUNDARY = b"--frame\r\nContent-Type: image/jpeg\r\n\r\n"
_MEDIA_TYPE = "multipart/x-mixed-replace; boundary=frame"


class _VideoClient:
    """One viewer's socket, written to directly or through ASGI."""

    def __init__(self, websocket: WebSocket, hub: Hub, every_s: float) -> None:
        self._websocket = websocket
        self._hub = hub
        limits = hub.config.limits
        self._pace = Pace(per_second=limits.frames_per_second, burst=limits.frames_per_second)
        self._refusals_left = limits.refused_before_closing
        self._shut_out = asyncio.Event()
        self._waiting: asyncio.Queue[EncodedFrame] = asyncio.Queue()
        self._direct = fast_path(websocket)
        self.viewer = Viewer(self._send, every_s, person_of(websocket))

    def _send(self, frame: EncodedFrame) -> None:
        if self._direct is not None:
            self._direct.write_now(frame.wire)
        else:
            self._waiting.put_nowait(frame)

    def _hear(self, message: str | bytes) -> None:
        """Take an acknowledgement; what is none is refused and counted."""
        try:
            now_s = self._hub.clock.now_s()
            if not self._pace.allows(now_s):
                raise ProtocolError(ErrorCode.TOO_FAST, "too many acknowledgements a second")
            if isinstance(message, str):
                raise ProtocolError(ErrorCode.MALFORMED, "acknowledgements are bytes, not text")
            self._hub.video.acknowledge(self.viewer, parse_acknowledgement(message), now_s)
        except ProtocolError as error:
            self._hub.refused[error.code] += 1
            self._refusals_left -= 1
            if self._refusals_left == 0:
                self._hub.video.remove(self.viewer)
                self._shut_out.set()

    async def run(self) -> None:
        await converse(
            self._websocket,
            self._hub.clock,
            hear=self._hear,
            sending=self._send_waiting(),
            shut_out=self._shut_out,
        )

    async def _send_waiting(self) -> None:
        while True:
            await self._websocket.send_bytes((await self._waiting.get()).message)


@router.websocket("/ws/video")
async def video(websocket: WebSocket) -> None:
    """Send the video to one viewer until it disconnects, `?every_ms=N` a frame every so often."""
    hub = services_of(websocket).hub
    await websocket.accept()
    every_ms = websocket.query_params.get("every_ms", "0")
    if not (every_ms.isdecimal() and len(every_ms) <= 5 and int(every_ms) <= _SELDOM_MS):
        await websocket.close(1008, f"every_ms must be a whole number up to {_SELDOM_MS}")
        return
    client = _VideoClient(websocket, hub, int(every_ms) / 1000)
    hub.show_newest()
    hub.video.add(client.viewer)
    try:
        await client.run()
    finally:
        hub.video.remove(client.viewer)


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
