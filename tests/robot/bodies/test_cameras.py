"""The pictures and error messages of three cameras: phone, Raspberry Pi, and OpenCV."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from robot.bodies.phone.camera import NOBODY, PhoneCamera, PhoneOptions
from robot.bodies.picamera2.camera import Picamera2Camera, Picamera2Options
from robot.bodies.webcam.camera import OpencvCamera, OpencvOptions
from robot.devkit.freshness import STILL_S
from robot.devkit.pictures import Picture
from robot.errors import CameraError
from robot.policy.image import to_rgb
from robot.testing import VirtualClock
from robot.types import Encoding
from tests.contract.test_cameras import write_film
from tests.kit.run import run
from tests.kit.wait import wait_until
from tests.standins import picamera2


@pytest.fixture
def camera() -> Iterator[PhoneCamera]:
    with PhoneCamera(PhoneOptions(), VirtualClock(100.0)) as running:
        yield running


def offer(camera: PhoneCamera, data: bytes, ago_s: float = 0.05, **how: bool) -> None:
    picture = Picture(encoding=Encoding.JPEG, width=4, height=3, data=data)
    camera.offer(picture, camera.clock.now_s() - ago_s, **how)


def test_before_the_first_picture_the_camera_says_how_to_connect_a_phone(
    camera: PhoneCamera,
) -> None:
    camera.clock.sleep(STILL_S + 0.1)
    assert camera.fault == NOBODY and camera.latest() is None
    offer(camera, b"one", 0.08)
    frame = camera.latest()
    assert camera.fault is None and frame is not None
    assert frame.captured_s == pytest.approx(camera.clock.now_s() - 0.08)


def test_time_stamps_are_never_in_the_future_and_never_go_back(camera: PhoneCamera) -> None:
    stamps = []
    for index, ago_s in enumerate([0.1, -5.0, 3.0, 0.0, 60.0]):
        camera.clock.sleep(0.05)
        offer(camera, bytes([index]), ago_s)
        frame = camera.latest()
        assert frame is not None and frame.captured_s <= camera.clock.now_s()
        stamps.append(frame.captured_s)
    assert stamps == sorted(stamps)


@pytest.mark.parametrize(("repeats", "said"), [(False, "no pictures"), (True, "repeats")])
def test_silence_and_a_frozen_picture_are_faults_in_time(
    camera: PhoneCamera, repeats: bool, said: str
) -> None:
    offer(camera, b"one")
    for _ in range(9):
        camera.clock.sleep(0.05)
        if repeats:
            offer(camera, b"one")
    assert said in (camera.fault or "")
    offer(camera, b"two")
    assert camera.fault is None


def test_a_covered_lens_is_a_fault_and_its_pictures_are_not_shown(camera: PhoneCamera) -> None:
    offer(camera, b"one")
    offer(camera, b"dark", covered=True)
    assert "covered" in (camera.fault or "")
    frame = camera.latest()
    assert frame is not None and frame.data == b"one"
    offer(camera, b"light")
    assert camera.fault is None


def test_a_phone_that_leaves_is_a_fault_at_once(camera: PhoneCamera) -> None:
    told: list[str | None] = []
    offer(camera, b"one")
    camera.listen(lambda: told.append(camera.fault))
    camera.lose()
    assert "disconnected" in (camera.fault or "") and told == [camera.fault]


def test_a_stopped_camera_accepts_no_picture(camera: PhoneCamera) -> None:
    camera.stop()
    offer(camera, b"one")
    camera.lose()
    assert camera.latest() is None and camera.fault is None


class StillPicamera2(picamera2.Picamera2):
    """A camera that delivers a picture whenever the test requests one."""

    def start(self) -> None:
        pass

    def stop(self) -> None:
        pass


LIBRARY = SimpleNamespace(Picamera2=StillPicamera2)


def made(**options: object) -> Picamera2Camera:
    return Picamera2Camera(Picamera2Options(**options), VirtualClock(), LIBRARY)


def test_pictures_have_the_right_colours_size_and_time() -> None:
    camera = made(width=64, height=48)
    camera.clock.sleep(5.0)
    with camera:
        camera._take(picamera2.Request(9, (64, 48)))
        frame = camera.latest()
    assert frame is not None and (frame.width, frame.height) == (64, 48)
    assert to_rgb(frame)[24, 32].tolist() == [63, 0, 0]
    age_s = camera.clock.now_s() - frame.captured_s
    assert age_s > 0.0199, "the frame is as old as the sensor states, 20 ms, apart from rounding"


def test_upside_down_turns_pictures_and_a_repeated_picture_counts_once() -> None:
    with made(width=64, height=48, upside_down=True) as camera:
        for _ in range(2):
            camera._take(picamera2.Request(9, (64, 48)))
        frame = camera.latest()
    assert frame is not None and frame.frame_id == 1
    assert to_rgb(frame)[-1].min() == 255 and to_rgb(frame)[0].max() == 63


def test_a_missing_or_used_camera_is_reported_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(CameraError, match=r"no camera module 1 \(1 found\)"):
        made(camera_number=1).start()
    with made(), pytest.raises(CameraError, match="another program"):
        made().start()
    monkeypatch.setitem(sys.modules, "picamera2", None)
    with pytest.raises(CameraError, match=r"apt install python3-picamera2.*--system-site-packages"):
        Picamera2Camera(Picamera2Options(), VirtualClock()).start()


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


def test_a_webcam_that_cannot_be_opened_is_reported_in_one_line(tmp_path: Path) -> None:
    camera = OpencvCamera(OpencvOptions(source=str(tmp_path / "none.avi")), VirtualClock())
    with pytest.raises(CameraError, match=r"cannot open .*none.avi.*--source"):
        camera.start()


_WITHOUT_LINUX = """
import sys, numpy  # it asks for what is gone below
sys.modules["fcntl"] = None
import os
vars(os).pop("O_NONBLOCK", None)
from robot.bodies.v4l2.device import CaptureError, describe_camera
try:
    describe_camera("/dev/video0")
except CaptureError as error:
    print(error)
"""


def test_the_camera_for_linux_suggests_this_one_on_other_systems() -> None:
    done = run(sys.executable, "-c", _WITHOUT_LINUX, encoding="utf-8")
    assert "--camera opencv" in done.stdout
