"""The contract of `robot.testing`, for each of our cameras.

`CASES` maps a plugin's name to a context manager that yields a case, or skips with a reason.
"""

from __future__ import annotations

import base64
import itertools
import os
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import cv2
import numpy as np
import pytest

from robot.bodies.ev3.remote_camera import Ev3RemoteCamera
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.gymnasium.camera import GymnasiumCamera, GymnasiumCameraOptions
from robot.bodies.mjpeg.camera import MjpegCamera, MjpegOptions
from robot.bodies.phone.camera import PhoneCamera, PhoneOptions
from robot.bodies.picamera2.camera import Picamera2Camera, Picamera2Options
from robot.bodies.ros.camera import RosCamera, RosCameraOptions
from robot.bodies.v4l2.camera import UsbCameraOptions, V4l2Camera
from robot.bodies.webcam.camera import OpencvCamera, OpencvOptions
from robot.clock import Clock, RealClock
from robot.devices.plugins import CAMERAS
from robot.devkit.pictures import read_jpeg
from robot.exchange.replay_camera import ReplayCamera, ReplayCameraOptions
from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions
from robot.testing import VirtualClock
from robot.testing.camera_contract import CameraContract
from robot.testing.cases import CameraCase
from tests.contract.test_drivers import line_of_pixels
from tests.faults.bodies import brick_in_memory
from tests.kit.frames import grey_jpeg
from tests.own_plugins import own_plugins
from tests.robot.bodies.ev3.fake_video import DEVICE
from tests.robot.bodies.ev3.virtual_agent import SimulatedCamera, VirtualAgent
from tests.robot.footage import write_footage
from tests.standins import picamera2


@contextmanager
def sim_camera() -> Iterator[CameraCase]:
    driver = SimDriver(SimOptions(world="office"))
    yield CameraCase(SimCamera(driver, SimCameraOptions(), VirtualClock()))


@contextmanager
def gymnasium_camera() -> Iterator[CameraCase]:
    yield CameraCase(GymnasiumCamera(line_of_pixels(), GymnasiumCameraOptions(), VirtualClock()))


@contextmanager
def ev3_remote_camera() -> Iterator[CameraCase]:
    if address := os.environ.get("DRIVELESSON_EV3"):
        driver = Ev3RemoteDriver(Ev3RemoteOptions(brick=address))
        yield CameraCase(Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(), RealClock()))
        return
    source = SimulatedCamera()
    with (
        brick_in_memory(VirtualClock(100.0)) as brick,
        VirtualAgent(brick, open_camera=source.open) as agent,
    ):
        driver = Ev3RemoteDriver(Ev3RemoteOptions(brick=agent.address), agent.link())
        camera = Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(), brick.clock)
        yield CameraCase(
            camera,
            lambda: setattr(source, "is_frozen", True),
            lambda: setattr(source, "is_frozen", False),
        )


@contextmanager
def v4l2_camera() -> Iterator[CameraCase]:
    if "FAKE_VIDEO" not in os.environ:
        pytest.skip(
            "tests/robot/bodies/ev3/test_v4l2.py tests it in a process with a simulated camera"
        )
    yield CameraCase(V4l2Camera(UsbCameraOptions(device=DEVICE), RealClock()))


@contextmanager
def opencv_camera() -> Iterator[CameraCase]:
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder, "film.avi")
        write_film(film)
        yield CameraCase(OpencvCamera(OpencvOptions(source=str(film)), VirtualClock()))


def write_film(path: Path, frames: int = 30) -> None:
    """Write a film in which all frames differ."""
    fourcc = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(path), fourcc, 30.0, (320, 240))
    for index in range(frames):
        writer.write(np.full((240, 320, 3), 5 * index, np.uint8))
    writer.release()


@contextmanager
def sending(clock: Clock, give: Callable[[int], None]) -> Iterator[threading.Event]:
    """Call `give` with a number every 30 ms, on a thread, unless the event is set."""
    ending, frozen = threading.Event(), threading.Event()

    def send() -> None:
        for index in itertools.count():
            if clock.wait(ending, 0.03):
                return
            if not frozen.is_set():
                give(index)

    thread = clock.start_thread(send, "pictures")
    yield frozen
    ending.set()
    thread.join()


@contextmanager
def phone_camera() -> Iterator[CameraCase]:
    """A phone whose pictures, each with another grey value, arrive on a thread."""
    clock = VirtualClock()
    camera = PhoneCamera(PhoneOptions(), clock)

    def give(index: int) -> None:
        camera.offer(read_jpeg(grey_jpeg(index)), clock.now_s())

    with sending(clock, give) as frozen:
        yield CameraCase(camera, frozen.set, frozen.clear)


@contextmanager
def picamera2_camera() -> Iterator[CameraCase]:
    clock, library = VirtualClock(), picamera2.Picamera2
    library.clock = clock
    library.is_frozen.clear()
    camera = Picamera2Camera(Picamera2Options(), clock, picamera2)
    yield CameraCase(camera, library.is_frozen.set, library.is_frozen.clear)
    library.is_frozen.clear()


@contextmanager
def ros_camera() -> Iterator[CameraCase]:
    """A camera with the pictures of a topic, over a bridge without a socket."""
    clock, listening = VirtualClock(), list[Any]()

    def open_topics(*_: Any, on_message: Any, **options: Any) -> Any:
        listening.append(on_message)
        return SimpleNamespace(refusal="", close=listening.clear)

    def give(index: int) -> None:
        jpeg = base64.b64encode(grey_jpeg(index)).decode()
        for tell in listening:
            tell("/camera/image_raw/compressed", {"format": "jpeg", "data": jpeg})

    with (
        mock.patch("robot.bodies.ros.camera.open_topics", open_topics),
        sending(clock, give) as frozen,
    ):
        camera = RosCamera(RosCameraOptions(address="base"), clock)
        yield CameraCase(camera, frozen.set, frozen.clear)


@contextmanager
def mjpeg_camera() -> Iterator[CameraCase]:
    """A stream without a socket, which delivers its parts one after the other."""
    clock, frozen = VirtualClock(), threading.Event()
    camera = MjpegCamera(MjpegOptions(source="http://camera/stream"), clock)

    indices = itertools.count()

    def read1(size: int) -> bytes:
        while not clock.wait(camera._ending, 0.03):
            if not frozen.is_set():
                jpeg = grey_jpeg(next(indices))
                head = f"--frame\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                return head.encode() + jpeg + b"\r\n"
        raise OSError("the stream was closed")

    camera._line = SimpleNamespace(
        host="camera", open=lambda: None, close=lambda: None, read1=read1
    )
    yield CameraCase(camera, frozen.set, frozen.clear)


@contextmanager
def replay_camera() -> Iterator[CameraCase]:
    with tempfile.TemporaryDirectory() as folder:
        path = write_footage(Path(folder) / "hall_A.npz", n_frames=8)
        yield CameraCase(ReplayCamera(ReplayCameraOptions(recording=str(path)), VirtualClock()))


CASES: dict[str, Callable[[], AbstractContextManager[CameraCase]]] = {
    "sim": sim_camera,
    "replay": replay_camera,
    "ev3-remote": ev3_remote_camera,
    "v4l2": v4l2_camera,
    "opencv": opencv_camera,
    "phone": phone_camera,
    "mjpeg": mjpeg_camera,
    "picamera2": picamera2_camera,
    "ros": ros_camera,
    "gymnasium": gymnasium_camera,
}


@pytest.fixture(params=own_plugins(CAMERAS))
def camera_case(request: pytest.FixtureRequest) -> Iterator[CameraCase]:
    assert request.param in CASES, f"CASES has no case for the camera {request.param!r}"
    with CASES[request.param]() as built:
        yield built
        built.camera.stop()


class TestEveryCamera(CameraContract):
    pass
