"""Viewers without a screen: they take frames, acknowledge them, and note how old each one is."""

from __future__ import annotations

import asyncio
import contextlib
import time
from dataclasses import dataclass, field

from server.lab.bench.naive import STAMP
from server.protocol import encode_acknowledgement, parse_picture


@dataclass(slots=True, kw_only=True)
class Watched:
    """What one viewer saw: when each frame came, and how old it then was, in seconds."""

    at_s: list[float] = field(default_factory=list)
    ages_s: list[float] = field(default_factory=list)

    def note(self, captured_s: float) -> None:
        now_s = time.monotonic()
        self.at_s.append(now_s)
        self.ages_s.append(now_s - captured_s)

    def since(self, start_s: float) -> list[float]:
        """Return the ages of the frames that came after `start_s`."""
        return [age for at, age in zip(self.at_s, self.ages_s, strict=True) if at >= start_s]


async def watch(kind: str, port: int, watched: Watched) -> None:
    """Watch one server until cancelled."""
    from websockets.asyncio.client import connect

    if kind == "naive-mjpeg":
        await _watch_mjpeg(port, watched)
        return
    url = f"ws://127.0.0.1:{port}/ws/video"
    # Browsers always offer to compress; whether they are taken up on it is the server's choice.
    async with connect(url, compression="deflate", max_size=None, ping_interval=None) as socket:
        async for message in socket:
            assert isinstance(message, bytes)
            if kind == "drivelesson":
                picture = parse_picture(message)
                watched.note(picture.captured_ms / 1000)
                if not picture.quiet:
                    await socket.send(encode_acknowledgement(picture.frame_id))
            else:
                watched.note(STAMP.unpack_from(message)[0])


async def _watch_mjpeg(port: int, watched: Watched) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(b"GET /video.mjpg HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        await reader.readuntil(b"\r\n\r\n")
        while True:
            head = await reader.readuntil(b"\r\n\r\n")
            size = int(head.rsplit(b"Content-Length: ", 1)[1])
            # NOTE: over HTTP/1.1 the parts come in chunks; one part is one chunk here.
            body = await reader.readexactly(size + 2)
            watched.note(STAMP.unpack_from(body)[0])
            await reader.readuntil(b"\r\n")
    finally:
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()
