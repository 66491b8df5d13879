"""A plain websocket server on uvicorn, with which the link benchmark compares Drivelesson's server.

The plain server sends bytes that were prepared beforehand. It makes no pictures, reads no
acknowledgements and has no limits. It runs in a separate process; the benchmark measures it and
Drivelesson's server in turns.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Awaitable, Callable
from multiprocessing.connection import Connection
from typing import Any

from robot.types import Encoding, Frame
from server.hosting.serving import open_socket
from server.protocol import encode_picture

_Send = Callable[[dict[str, Any]], Awaitable[None]]


class PlainVideo:
    """An ASGI application that sends every message to every client, even to slow ones."""

    def __init__(self, size: int, rate_hz: float) -> None:
        self._picture, self._period_s = b"\0" * size, 1.0 / rate_hz
        self._clients: set[_Send] = set()
        self.frames = 0

    async def __call__(self, scope: dict[str, Any], receive: Any, send: _Send) -> None:
        if scope["type"] != "websocket":
            return
        await receive()
        await send({"type": "websocket.accept"})
        self._clients.add(send)
        try:
            while (await receive())["type"] != "websocket.disconnect":
                pass
        finally:
            self._clients.discard(send)

    async def push(self) -> None:
        """Send messages to all clients at the given rate."""
        due_s = time.monotonic()
        while True:
            due_s += self._period_s
            await asyncio.sleep(max(0.0, due_s - time.monotonic()))
            self.frames += 1
            frame = Frame(
                frame_id=self.frames,
                captured_s=time.monotonic(),
                width=160,
                height=120,
                encoding=Encoding.JPEG,
                data=self._picture,
            )
            message = {"type": "websocket.send", "bytes": encode_picture(frame, is_quiet=True)}
            for send in list(self._clients):
                with contextlib.suppress(Exception):  # the client has just left
                    await send(message)


def serve_plain(line: Connection, size: int, rate_hz: float) -> None:
    """Send the port of the server through the pipe; answer commands until the pipe is closed."""
    import uvicorn

    listener, app = open_socket("127.0.0.1", 0), PlainVideo(size, rate_hz)
    config = uvicorn.Config(
        app, ws="websockets-sansio", ws_per_message_deflate=False, lifespan="off", log_config=None
    )
    server = uvicorn.Server(config)

    async def run() -> None:
        pushing = asyncio.create_task(app.push())
        await server.serve(sockets=[listener])
        pushing.cancel()

    thread = threading.Thread(target=lambda: asyncio.run(run()), name="server")
    thread.start()
    line.send(listener.getsockname()[1])
    with contextlib.suppress(EOFError):
        while True:
            line.recv()
            spent_s = time.clock_gettime(time.pthread_getcpuclockid(thread.ident or 0))
            found = {"serving_s": spent_s, "process_s": time.process_time(), "frames": app.frames}
            line.send({**found, "late_cycles": 0, "stops": 0, "ticked_s": []})
    server.should_exit = True
    thread.join(10)
