"""The opencv camera with a film, and with captures that break like real ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from robot.bodies.webcam.camera import OpencvCamera, OpencvOptions
from robot.errors import CameraError
from robot.testing import VirtualClock
from robot.types import Encoding
from tests.contract.camera_cases import write_film
from tests.kit.wait import wait_until


class BreakableCapture:
    """Behaves like cv2.VideoCapture of a webcam: 30 pictures a second, until it breaks."""

    clock: VirtualClock
    how = "run"
    noise = np.random.default_rng(1)
    last = np.zeros((240, 320, 3), np.uint8)

    def __init__(self, source: Any) -> None:
        self.source = source

    def isOpened(self) -> bool:  # noqa: N802 - OpenCV's name
        return self.how != "gone"

    def read(self) -> tuple[bool, Any]:
        self.clock.sleep(0.03)
        cls = type(self)
        if self.how == "run":
            cls.last = self.noise.integers(0, 255, (240, 320, 3), dtype=np.uint8)
        while self.how == "block":
            self.clock.sleep(0.01)
        # After the camera is unplugged, OpenCV keeps returning the last picture without an error.
        return self.how != "gone", cls.last

    def set(self, what: int, value: float) -> bool:
        return True

    def get(self, what: int) -> float:
        return 30.0

    def release(self) -> None:
        pass


@pytest.mark.parametrize(
    ("how", "words"),
    [("repeat", "repeats one picture"), ("gone", "gives no pictures"), ("block", "no pictures")],
)
def test_a_broken_webcam_is_noticed_within_500_ms_and_picked_up_again(
    monkeypatch: pytest.MonkeyPatch, how: str, words: str
) -> None:
    clock = VirtualClock()
    capture = type("Capture", (BreakableCapture,), {"clock": clock})
    monkeypatch.setattr(cv2, "VideoCapture", capture)
    with OpencvCamera(OpencvOptions(source="0"), clock) as camera:
        wait_until(lambda: camera.latest() is not None, within_s=5.0, clock=clock)
        capture.how = how
        assert wait_until(lambda: camera.fault is not None, within_s=5.0, clock=clock) <= 0.5
        assert words in str(camera.fault)
        capture.how = "run"
        wait_until(lambda: camera.fault is None, within_s=5.0, clock=clock)


def test_frames_are_small_jpegs_of_the_film_which_begins_again(tmp_path: Path) -> None:
    film = tmp_path / "film.avi"
    write_film(film, frames=10)
    clock = VirtualClock()
    with OpencvCamera(OpencvOptions(source=str(film)), clock) as camera:
        wait_until(
            lambda: (frame := camera.latest()) is not None and frame.frame_id > 12,
            within_s=5.0,
            clock=clock,
        )
        frame = camera.latest()
    assert frame is not None
    assert (frame.width, frame.height, frame.encoding) == (160, 120, Encoding.JPEG)
    decoded = cv2.imdecode(np.frombuffer(frame.data, np.uint8), cv2.IMREAD_COLOR)
    assert decoded.shape == (120, 160, 3)
    assert camera.fault is None


def test_a_webcam_that_cannot_be_opened_is_one_clear_line(tmp_path: Path) -> None:
    camera = OpencvCamera(OpencvOptions(source=str(tmp_path / "none.avi")), VirtualClock())
    with pytest.raises(CameraError, match=r"cannot open .*none.avi.*--source"):
        camera.start()
