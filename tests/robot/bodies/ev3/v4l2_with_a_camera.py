"""Runs the real ioctl code with a simulated camera, in a process that test_v4l2.py starts."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from robot.bodies.v4l2.camera import UsbCameraOptions, V4l2Camera
from robot.bodies.v4l2.device import describe_camera
from robot.clock import RealClock
from robot.errors import CameraError
from robot.types import Encoding, Frame
from tests.kit.wait import wait_until
from tests.robot.bodies.ev3.fake_video import DEVICE, behave

pytestmark = pytest.mark.realtime


def camera(device: str = DEVICE, encoding: str = "auto") -> V4l2Camera:
    return V4l2Camera(UsbCameraOptions(device=device, encoding=encoding), RealClock())


def newest(camera: V4l2Camera, after: int = 0) -> Frame:
    def has_come() -> bool:
        frame = camera.latest()
        return frame is not None and frame.frame_id > after

    wait_until(has_come, f"a picture after {after}")
    frame = camera.latest()
    assert frame is not None
    return frame


def check_that_it_shows_the_ramp(frame: Frame) -> None:
    pixels = np.frombuffer(frame.data, np.uint8).reshape(frame.height, frame.width, 2)
    assert frame.encoding is Encoding.YUYV
    assert (pixels[:, :, 1] == 128).all(), "the colour bytes stay unchanged"
    steps = [np.unique(np.diff(pixels[:, :, 0], axis=axis)).tolist() for axis in (0, 1)]
    assert steps[0] == steps[1] and len(steps[0]) == 1


def test_yuyv_comes_as_it_is_and_a_broken_camera_is_noticed_and_picked_up_again() -> None:
    with camera() as running:
        frame = newest(running, 3)
        assert (frame.width, frame.height) == (160, 120)
        check_that_it_shows_the_ramp(frame)

        def age_s() -> float:
            now = running.latest()
            return time.monotonic() - now.captured_s if now is not None else 0.0

        wait_until(lambda: age_s() < 0.1)
        assert age_s() >= 0.00499, "a picture is 5 ms old when it is delivered"
        behave("gone", os.environ["FAKE_VIDEO"])
        wait_until(lambda: f"{DEVICE} was unplugged" in str(running.fault))
        shown = newest(running).frame_id
        behave("run", os.environ["FAKE_VIDEO"])
        wait_until(lambda: running.fault is None)
        newest(running, shown)


def test_a_large_picture_is_shrunk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FAKE_VIDEO_SIZES", "352x288,800x600")
    with camera() as running:
        frame = newest(running)
    assert (frame.width, frame.height) == (160, 120)
    check_that_it_shows_the_ramp(frame)


@pytest.mark.parametrize("format_name", ["MJPG", "JPEG"])
def test_a_jpeg_is_passed_on_unchanged_where_it_can_be_decoded(
    monkeypatch: pytest.MonkeyPatch, format_name: str
) -> None:
    monkeypatch.setenv("FAKE_VIDEO_FORMAT", format_name)
    with camera() as running:
        frame = newest(running)
    assert frame.encoding is Encoding.JPEG and frame.data.startswith(b"\xff\xd8\xff")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    said = rf"{DEVICE} has only MJPEG, .*cannot read.*camera with YUYV.*brick agent ADDRESS"
    with pytest.raises(CameraError, match=said):
        camera().start()


def test_what_a_camera_offers_is_described(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FAKE_VIDEO_FORMAT", "YUYV,MJPG")
    monkeypatch.setenv("FAKE_VIDEO_SIZES", "160x120,320x240")
    sizes = ["160x120", "320x240"]
    assert describe_camera(DEVICE) == {"YUYV": sizes, "MJPG": sizes}


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"device": "/dev/video77"}, r"no camera at /dev/video77 \(No such file.*; .*--device$"),
        ({"encoding": "jpeg"}, f"the camera {DEVICE} does not support jpeg; it supports: YUYV$"),
    ],
)
def test_a_missing_camera_is_reported_in_one_line(wanted: dict[str, str], said: str) -> None:
    with pytest.raises(CameraError, match=f"^Camera: {said}"):
        camera(**wanted).start()
