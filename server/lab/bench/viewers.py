"""Viewers without a screen: they take frames, acknowledge them, and note how old each one is."""

from __future__ import annotations

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
