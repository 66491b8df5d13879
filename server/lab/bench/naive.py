"""What one writes first: a server to compare with, after the recipes that are found everywhere."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable

from fastapi import FastAPI, WebSocket

from robot.camera import Camera
from robot.types import Frame
from server.clients.video import Encoder

STAMP = struct.Struct("<d")
"""Each frame starts with the time at which it was taken, so that its way can be measured."""


def naive_websocket(camera: Camera) -> FastAPI:
    """Push every frame into a queue for each client, and out of it as fast as it goes.

    The frame is encoded once for all, which is kinder than most recipes.
    """
    app = FastAPI()
    encoder = Encoder(80)
    queues: set[asyncio.Queue[bytes]] = set()

    def spread(frame: Frame) -> None:
        if queues:
            message = STAMP.pack(frame.captured_s) + encoder.encode_jpeg(frame)
            for queue in queues:
                queue.put_nowait(message)

    @app.websocket("/ws/video")
    async def video(websocket: WebSocket) -> None:
        await websocket.accept()
        _listen(camera, spread)
        queue: asyncio.Queue[bytes] = asyncio.Queue()
        queues.add(queue)
        try:
            while True:
                await websocket.send_bytes(await queue.get())
        except Exception:
            return
        finally:
            queues.discard(queue)

    return app


def _listen(camera: Camera, spread: Callable[[Frame], None]) -> None:
    """Have each new frame spread on the event loop; the camera has one listener, set once."""
    event_loop = asyncio.get_running_loop()

    def on_frame() -> None:
        frame = camera.latest()
        if frame is not None:
            event_loop.call_soon_threadsafe(spread, frame)

    camera.listen(on_frame)
