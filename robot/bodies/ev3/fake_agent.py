"""A brick's agent on a thread, over a brick made of files, with a camera as an EV3 has it."""

from __future__ import annotations

import os
import socket
import threading
from typing import Any

from robot.bodies.ev3.agent.inspection import inspect_brick
from robot.bodies.ev3.agent.server import Agent
from robot.bodies.ev3.archive import release
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.v4l2.device import VideoFrame
from robot.types import StartStop

SECRET = "the secret of a fake brick"
PERIOD_S = 0.1
AGE_S, AGE_SPREAD_S = 0.095, 0.05
"""A Logitech C270 on an EV3's bus: how old a picture is when it arrives, by the kernel's stamp."""


class FakeCameraReader:
    """Stands in for `CameraReader`, and for its `video`: grey pictures, ten a second, 95 to 145 ms
    old."""

    path, width, height, encoding = "/dev/video0", 160, 120, "yuyv"

    def __init__(self, *_wanted: Any) -> None:
        self.video = self
        self.fault: str | None = None
        self._pipe = os.pipe()
        self._next_s = 0.0
        self._n = 0

    def fileno(self) -> int:
        """A descriptor that never becomes readable; the agent polls as well."""
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


def inspect_as_ev3(root: str, late: int) -> dict[str, Any]:
    """Return what a brick with ev3dev's stock image and a C270 would."""
    return {
        **inspect_brick(root, late),
        "release": release(),
        "python": "3.5.3",
        "kernel": "4.14.117-ev3dev-2.3.5-ev3",
        "machine": "armv5tejl",
        "cameras": [{"device": "/dev/video0", "offers": {"YUYV": ["160x120"]}}],
    }


class FakeAgent(StartStop):
    """A context manager: the real agent on a thread; `address` is where it listens."""

    def __init__(self, brick: FakeBrick) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._agent = Agent(
            self._listener,
            SECRET,
            str(brick.root),
            open_camera=FakeCameraReader,
            inspect=inspect_as_ev3,
            note=lambda text: None,
        )
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="fake-agent", daemon=True)

    def _serve(self) -> None:
        while not self._ending.is_set():
            self._agent.tick()

    def start(self) -> None:
        if self._thread.ident is None:
            self._thread.start()

    def stop(self) -> None:
        self._ending.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._agent.close()
