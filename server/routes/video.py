"""`/ws/video`: frames down, acknowledgements up. A thin shell around the video hub."""

from __future__ import annotations

import time
from collections.abc import MutableMapping
from typing import Any

from fastapi import APIRouter, WebSocket

from server.protocol import ErrorCode, ProtocolError, parse_acknowledgement
from server.session import Pace
from server.station import Station
from server.video import Viewer

router = APIRouter()


@router.websocket("/ws/video")
async def video(websocket: WebSocket) -> None:
    """Show the picture to one viewer for as long as it is there."""
    station: Station = websocket.app.state.station
    await websocket.accept()
    viewer = Viewer(websocket.send_bytes)
    limits = station.config.limits
    pace = Pace(per_second=limits.frames_per_second, burst=limits.frames_per_second)
    refused = 0
    await station.watch(viewer)
    try:
        while True:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            try:
                _hear(station, viewer, pace, message)
                await station.video.offer(viewer)
            except ProtocolError as error:
                station.refused[error.code] += 1
                refused += 1
                if refused >= limits.refused_before_closing:
                    await websocket.close(1008, "too many refused messages")
                    return
    finally:
        station.video.remove(viewer)


def _hear(station: Station, viewer: Viewer, pace: Pace, message: MutableMapping[str, Any]) -> None:
    now_s = time.monotonic()
    if not pace.allows(now_s):
        raise ProtocolError(ErrorCode.TOO_FAST, "too many acknowledgements a second")
    data = message.get("bytes")
    if not isinstance(data, bytes):
        raise ProtocolError(ErrorCode.MALFORMED, "acknowledgements are bytes, not text")
    station.video.acknowledge(viewer, parse_acknowledgement(data), now_s)
