"""Replaces Raspberry Pi's library `picamera2`, which needs the Pi's own libcamera.

Names, arguments and the order of calls are those of picamera2 0.3.38.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from robot.clock import Clock, RealClock, Worker

RATE_HZ = 60.0


class Request:
    """A completed request: one picture and its metadata."""

    def __init__(self, index: int, size: tuple[int, int]) -> None:
        self._index, self._size = index, size
        self._stamp_ns = time.monotonic_ns() - 20_000_000  # the exposure precedes the readout

    def make_array(self, name: str) -> np.ndarray[Any, np.dtype[np.uint8]]:
        assert name == "main"
        width, height = self._size
        picture = np.zeros((height, width, 3), np.uint8)
        picture[..., 0] = 7 * self._index % 256  # red
        picture[0] = 255
        return picture

    def get_metadata(self) -> dict[str, Any]:
        return {"SensorTimestamp": self._stamp_ns, "ExposureTime": 10_000}


class Picamera2:
    """One camera; a second `Picamera2` at the same time is refused, as by libcamera."""

    n_cameras = 1
    is_frozen = threading.Event()
    clock: Clock = RealClock()
    """The clock that stamps the pictures."""
    _open = threading.Lock()

    @staticmethod
    def global_camera_info() -> list[dict[str, Any]]:
        return [{"Model": "imx708", "Num": number} for number in range(Picamera2.n_cameras)]

    def __init__(self, camera_num: int = 0) -> None:
        if not Picamera2._open.acquire(blocking=False):
            raise RuntimeError("Camera __init__ sequence did not complete.")
        self.pre_callback: Callable[[Request], None] | None = None
        self._size = (0, 0)
        self._ending = threading.Event()
        self._thread: Worker | None = None

    def create_video_configuration(self, **wanted: Any) -> dict[str, Any]:
        assert set(wanted) <= {"main", "controls", "buffer_count"}
        return wanted

    def configure(self, configuration: dict[str, Any]) -> None:
        main = configuration["main"]
        if main["format"] != "BGR888":
            raise RuntimeError("only these colours are simulated")
        self._size = main["size"]

    def start(self) -> None:
        self._thread = self.clock.start_thread(self._run, "picamera2")

    def _run(self) -> None:
        index = 0
        while not self.clock.wait(self._ending, 1 / RATE_HZ):
            index += not Picamera2.is_frozen.is_set()
            if self.pre_callback is not None and not Picamera2.is_frozen.is_set():
                self.pre_callback(Request(index, self._size))

    def stop(self) -> None:
        self._ending.set()
        if self._thread is not None:
            self._thread.join()

    def close(self) -> None:
        Picamera2._open.release()
