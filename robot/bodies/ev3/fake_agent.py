"""Runs a brick's real agent on a thread, with a simulated brick and a fake camera."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from robot.bodies.ev3.agent.inspection import inspect_brick
from robot.bodies.ev3.agent.server import Agent
from robot.bodies.ev3.archive import release
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.v4l2.device import VideoFrame

SECRET = "the secret of a fake brick"
PERIOD_S = 0.1
AGE_S, AGE_SPREAD_S = 0.095, 0.05
"""A picture of the fake camera is `AGE_S` to `AGE_S + AGE_SPREAD_S` seconds old when it arrives,
like a picture of a USB camera (Logitech C270) on an EV3."""


class FakeCameraReader:
    """Fake camera of a brick, which replaces both `CameraReader` and its attribute `video`. Takes
    ten grey pictures a second, 95 to 145 ms old."""

    path, width, height, encoding = "/dev/video0", 160, 120, "yuyv"

    def __init__(self, *_wanted: Any) -> None:
        self.video = self
        self.fault: str | None = None
        self._pipe = os.pipe()
        self._next_s = 0.0
        self._n = 0

    def fileno(self) -> int:
        """Return a descriptor that never becomes readable, because the agent polls the fake
        camera."""
        return self._pipe[0]

    def poll(self, now_s: float) -> VideoFrame | None:
        if now_s < self._next_s:
            return None
        self._next_s = max(self._next_s + PERIOD_S, now_s)
        self._n += 1
        data = bytes([self._n % 256, 128]) * (self.width * self.height)
        return VideoFrame(data, now_s - AGE_S - AGE_SPREAD_S * (self._n % 6) / 5)

    def close(self) -> None:
        for end in self._pipe:
            os.close(end)


def inspect_as_ev3(root: str) -> dict[str, Any]:
    """Return the inspection of a brick with ev3dev's stock image and a C270."""
    return {
        **inspect_brick(root),
        "release": release(),
        "python": "3.5.3",
        "kernel": "4.14.117-ev3dev-2.3.5-ev3",
        "machine": "armv5tejl",
        "cameras": [{"device": "/dev/video0", "offers": {"YUYV": ["160x120"]}}],
    }


@contextmanager
def fake_agent(brick: FakeBrick) -> Iterator[str]:
    """Run the real agent on a thread; yield the address at which it listens."""
    listener, ending = socket.create_server(("127.0.0.1", 0)), threading.Event()
    agent = Agent(
        listener,
        SECRET,
        str(brick.root),
        open_camera=FakeCameraReader,
        inspect=inspect_as_ev3,
        note=lambda text: None,
    )

    def serve() -> None:
        while not ending.is_set():
            agent.tick()

    thread = threading.Thread(target=serve, name="fake-agent", daemon=True)
    thread.start()
    try:
        yield f"127.0.0.1:{listener.getsockname()[1]}"
    finally:
        ending.set()
        thread.join()
        agent.close()
