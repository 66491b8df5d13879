"""`/ws/video`: sends frames, receives acknowledgements. A thin shell around the video hub."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter, WebSocket

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
        """Serve the viewer until it disconnects."""
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
