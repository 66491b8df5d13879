"""How the contract suites build each driver and camera that is installed here.

An entry maps a plugin's name to a context manager that yields a case, or skips with a reason.
A plugin without an entry fails the suite: nothing joins the registry untested.
"""

from __future__ import annotations

import base64
import itertools
import math
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import cv2
import numpy as np
import pytest

from robot.bodies.ev3.driver import Ev3Driver, Ev3Options
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.remote_camera import Ev3RemoteCamera
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.gpio.driver import GpioOptions
from robot.bodies.gymnasium.camera import GymnasiumCamera, GymnasiumCameraOptions
from robot.bodies.gymnasium.driver import GymnasiumDriver, GymnasiumOptions
from robot.bodies.mjpeg.camera import MjpegCamera, MjpegOptions
from robot.bodies.phone.camera import PhoneCamera, PhoneOptions
from robot.bodies.picamera2.camera import Picamera2Camera, Picamera2Options
from robot.bodies.ros.camera import RosCamera, RosCameraOptions
from robot.bodies.v4l2.camera import UsbCameraOptions, V4l2Camera
from robot.bodies.webcam.camera import OpencvCamera, OpencvOptions
from robot.clock import Clock, RealClock
from robot.devices.pictures import read_jpeg
from robot.devices.simulation.camera import SimCamera, SimCameraOptions
from robot.devices.simulation.driver import SimDriver, SimOptions
from robot.errors import DriveError, NotConnectedError
from robot.exchange.replay_camera import ReplayCamera, ReplayCameraOptions
from robot.exchange.replay_driver import ReplayDriver
from robot.testing import VirtualClock
from robot.testing.cases import CameraCase, DriverCase
from robot.types import Action, Point
from tests.faults.bodies import BODIES, TimedBody
from tests.robot.bodies.ev3.fake_video import DEVICE
from tests.robot.bodies.ev3.virtual_agent import MadeUpCamera, VirtualAgent
from tests.robot.footage import write_footage
from tests.standins import picamera2


@contextmanager
def sim_driver() -> Iterator[DriverCase]:
    driver = SimDriver(SimOptions(world="office"))

    def is_moving() -> bool:
        before = driver.simulation.pose
        driver.advance(0.02)
        return driver.simulation.pose != before

    def drives() -> Point:
        simulation = driver.simulation
        simulation.is_noisy = False
        before = simulation.pose
        simulation.step(0.02)
        after, simulation.pose = simulation.pose, before
        way = math.cos(before.heading_rad) * (after.x_m - before.x_m)
        way += math.sin(before.heading_rad) * (after.y_m - before.y_m)
        return Point(before.heading_rad - after.heading_rad, way)

    yield DriverCase(driver, driver.advance, is_moving, budget_s=5.0, drives=drives)


def as_point(wheels: tuple[float, float]) -> Point:
    """Return how a body turns and drives whose left and right wheel do this."""
    left, right = wheels
    return Point(left - right, left + right)


@contextmanager
def sim_camera() -> Iterator[CameraCase]:
    driver = SimDriver(SimOptions(world="office"))
    yield CameraCase(SimCamera(driver, SimCameraOptions(), VirtualClock()))


BOX = "left=-0.6,0.1; right=0.6,0.1; forward=0,0.3; backward=0,-0.5"


def line_of_pixels(moves: str = "") -> GymnasiumDriver:
    pytest.importorskip("gymnasium", reason="an extra, and not of Debian 12's versions")
    line, form = "tests.standins.gymnasium_line:Line", "box" if moves else "discrete"
    return GymnasiumDriver(
        GymnasiumOptions(env=line, env_options=f"width=101,form={form}", env_moves=moves)
    )


@contextmanager
def gymnasium_driver(moves: str = "") -> Iterator[DriverCase]:
    driver = line_of_pixels(moves)

    def is_moving() -> bool:
        driver.advance(0.0)  # opens it
        environment: Any = driver._environment
        before = environment.env.unwrapped.n_steps
        driver.advance(0.02)
        return bool(environment.env.unwrapped.n_steps != before)

    def drives() -> Point:
        is_moving()
        environment: Any = driver._environment
        return Point(*map(float, environment.env.unwrapped.action))

    yield DriverCase(driver, driver.advance, is_moving, budget_s=5.0, drives=drives)
    driver.close()


@contextmanager
def gymnasium_camera() -> Iterator[CameraCase]:
    yield CameraCase(GymnasiumCamera(line_of_pixels(), GymnasiumCameraOptions(), VirtualClock()))


@contextmanager
def fake_brick(clock: Clock | None = None) -> Iterator[tuple[FakeBrick, Path]]:
    with (
        tempfile.TemporaryDirectory() as folder,
        FakeBrick(Path(folder, "brick"), clock=clock) as brick,
    ):
        brick.add_sensor("in4", "lego-ev3-us", 1234, decimals=1)
        for bumper in ("in1", "in2"):
            brick.add_sensor(bumper, "lego-ev3-touch", 0)
        yield brick, Path(folder)


def brick_case(
    driver: Ev3Driver | Ev3RemoteDriver,
    brick: FakeBrick,
    cut_link: Callable[[], None] | None = None,
    mend_link: Callable[[], None] | None = None,
) -> DriverCase:
    def is_moving() -> bool:
        try:
            driver.rolled_m()  # an answer: whatever was sent before has arrived
        except (DriveError, NotConnectedError):  # nobody is there to answer
            brick.clock.sleep(0.05)
        brick.catch_up()
        return brick.is_moving()

    def drives() -> Point:
        is_moving()
        return as_point((brick.speeds()["outB"], brick.speeds()["outC"]))

    now_s = brick.clock.now_s
    return DriverCase(
        driver, brick.clock.sleep, is_moving, cut_link, now_s, mend_link=mend_link, drives=drives
    )


@contextmanager
def ev3_driver() -> Iterator[DriverCase]:
    clock = VirtualClock()
    with fake_brick(clock) as (brick, _):
        driver = Ev3Driver(Ev3Options(brick_root=str(brick.root)), clock)

        def unplug_motors() -> None:  # its line is the motors' cables
            for port in driver._connection.motors._ports:  # type: ignore[union-attr]
                for file in port._files.values():
                    file.close()  # on a brick the next write fails with ENODEV
            for name in ("outB", "outC"):
                brick.unplug_motor(name)

        yield brick_case(driver, brick, unplug_motors)


def real_brick_case(address: str) -> DriverCase:
    """A brick on the table, by `pytest --ev3 ADDRESS`: it moves if its wheels' counters do."""
    driver = Ev3RemoteDriver(Ev3RemoteOptions(brick=address))

    def is_moving() -> bool:
        body = driver if driver.is_connected else Ev3RemoteDriver(driver.options)
        body.connect()
        before = body.rolled_m()
        time.sleep(0.1)
        after = body.rolled_m()
        if body is not driver:
            body.disconnect()
        return max(abs(b - a) for a, b in zip(before, after, strict=True)) > 0.001

    return DriverCase(driver, time.sleep, is_moving)


@contextmanager
def ev3_remote_driver() -> Iterator[DriverCase]:
    if address := os.environ.get("DRIVELESSON_EV3"):
        yield real_brick_case(address)
        return
    with fake_brick(VirtualClock(100.0)) as (brick, _), VirtualAgent(brick) as agent:
        driver = Ev3RemoteDriver(Ev3RemoteOptions(brick=agent.address), agent.link())
        yield brick_case(driver, brick, agent.cut, agent.mend)


@contextmanager
def ev3_remote_camera() -> Iterator[CameraCase]:
    if address := os.environ.get("DRIVELESSON_EV3"):
        driver = Ev3RemoteDriver(Ev3RemoteOptions(brick=address))
        yield CameraCase(Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(), RealClock()))
        return
    source = MadeUpCamera()
    with (
        fake_brick(VirtualClock(100.0)) as (brick, _),
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
            "tests/robot/bodies/ev3/test_v4l2.py runs it in a process that sees a made-up camera"
        )
    yield CameraCase(V4l2Camera(UsbCameraOptions(device=DEVICE), RealClock()))


@contextmanager
def opencv_camera() -> Iterator[CameraCase]:
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder, "film.avi")
        write_film(film)
        yield CameraCase(OpencvCamera(OpencvOptions(source=str(film)), VirtualClock()))


def write_film(path: Path, frames: int = 30) -> None:
    """Write a film in which no two frames are alike."""
    fourcc = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(path), fourcc, 30.0, (320, 240))
    for index in range(frames):
        writer.write(np.full((240, 320, 3), 5 * index, np.uint8))
    writer.release()


@contextmanager
def phone_camera() -> Iterator[CameraCase]:
    """A phone whose pictures come on a thread, each another grey, as from its socket."""
    clock = VirtualClock()
    camera = PhoneCamera(PhoneOptions(), clock)
    ending, frozen = threading.Event(), threading.Event()

    def send() -> None:
        for index in itertools.count():
            if clock.wait(ending, 0.03):
                return
            if not frozen.is_set():
                camera.offer(read_jpeg(grey_jpeg(index)), clock.now_s())

    phone = clock.start_thread(send, "phone")
    yield CameraCase(camera, frozen.set, frozen.clear)
    ending.set()
    phone.join()


def case_of(body: TimedBody, is_moving: Callable[[], bool]) -> DriverCase:
    def drives() -> Point:
        is_moving()
        assert body.wheels is not None
        return as_point(body.wheels())

    return DriverCase(
        body.driver,
        body.clock.sleep,
        is_moving,
        body.lose,
        body.clock.now_s,
        mend_link=body.regain,
        drives=drives if body.wheels is not None else None,
    )


@contextmanager
def timed_driver(name: str) -> Iterator[DriverCase]:
    """A body of tests/faults/bodies.py: the real driver and firmware on one virtual clock."""
    with BODIES[name][0](1) as body:
        body.slow_down(0.02)
        yield case_of(body, body.is_moving)
        body.driver.disconnect()


@contextmanager
def ros_driver() -> Iterator[DriverCase]:
    """A base that never stops by itself, with our watchdog before it."""
    with BODIES["ros"][0](1) as body:
        body.slow_down(0.02)

        def is_moving() -> bool:
            body.clock.sleep(0.03)  # what was sent has arrived
            return body.is_moving()

        yield case_of(body, is_moving)
        body.driver.disconnect()


@contextmanager
def gpio_driver(motor_board: str = "two-pwm") -> Iterator[DriverCase]:
    pytest.importorskip("gpiozero", reason="an extra, and not of Debian 12's versions")
    from tests.standins.gpio import MockPins

    clock = VirtualClock()
    with MockPins(clock) as pins:
        driver = pins.driver(GpioOptions(motor_board=motor_board))
        yield DriverCase(
            driver,
            pins.forward,
            lambda: pins.is_moving,
            pins.freeze_program,
            clock.now_s,
            drives=lambda: Point(*pins.car) if pins.is_car else as_point(pins.wheels),
        )
        driver.disconnect()


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
    """Pictures of a topic, on a bridge without a socket."""
    clock, frozen = VirtualClock(), threading.Event()

    class Bridge:
        def __init__(self, address: str, clock: Clock, **options: Any) -> None:
            self._ending, self._tell = threading.Event(), options["on_message"]
            self._thread = clock.start_thread(self._run, "rosbridge")

        def close(self) -> None:
            self._ending.set()
            self._thread.join()

        def _run(self) -> None:
            for index in itertools.count():
                if clock.wait(self._ending, 0.03):
                    return
                if not frozen.is_set():
                    jpeg = base64.b64encode(grey_jpeg(index)).decode()
                    self._tell("/camera/image_raw/compressed", {"format": "jpeg", "data": jpeg})

    with mock.patch("robot.bodies.ros.camera.RosBridge", Bridge):
        yield CameraCase(
            RosCamera(RosCameraOptions(address="base"), clock), frozen.set, frozen.clear
        )


@contextmanager
def mjpeg_camera() -> Iterator[CameraCase]:
    """A stream without a socket: its parts come one after the other."""
    clock, frozen = VirtualClock(), threading.Event()
    camera = MjpegCamera(MjpegOptions(source="http://camera/stream"), clock)

    class Line:
        host = "camera"

        def __init__(self) -> None:
            self._indices = itertools.count()

        def open(self) -> None: ...

        def close(self) -> None: ...

        def read1(self, size: int) -> bytes:
            while not clock.wait(camera._ending, 0.03):
                if not frozen.is_set():
                    jpeg = grey_jpeg(next(self._indices))
                    head = f"--frame\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                    return head.encode() + jpeg + b"\r\n"
            raise OSError("the stream was closed")

    camera._line = Line()  # type: ignore[assignment]
    yield CameraCase(camera, frozen.set, frozen.clear)


def grey_jpeg(index: int) -> bytes:
    """Return a picture of another grey for each index."""
    grey = np.full((24, 32, 3), 7 * index % 256, np.uint8)
    return cv2.imencode(".jpg", grey)[1].tobytes()


@contextmanager
def replay_driver() -> Iterator[DriverCase]:
    clock = VirtualClock()
    driver = ReplayDriver(clock=clock)
    is_moving = lambda: driver.action is not Action.STOP  # noqa: E731
    yield DriverCase(driver, clock.advance, is_moving, now_s=clock.now_s)


@contextmanager
def replay_camera() -> Iterator[CameraCase]:
    with tempfile.TemporaryDirectory() as folder:
        path = write_footage(Path(folder) / "hall_A.npz", n_frames=8)
        yield CameraCase(ReplayCamera(ReplayCameraOptions(recording=str(path)), VirtualClock()))


DRIVERS: dict[str, Callable[[], AbstractContextManager[DriverCase]]] = {
    "sim": sim_driver,
    "replay": replay_driver,
    "ev3": ev3_driver,
    "ev3-remote": ev3_remote_driver,
    "ev3-stock": partial(timed_driver, "ev3-stock"),
    "udp": partial(timed_driver, "udp"),
    "ws": partial(timed_driver, "ws"),
    "pybricks": partial(timed_driver, "pybricks"),
    "gpio": gpio_driver,
    "gpio, a car": partial(gpio_driver, "servo-esc"),
    "gymnasium": gymnasium_driver,
    "gymnasium, a box": partial(gymnasium_driver, BOX),
    "ros": ros_driver,
}
CAMERAS: dict[str, Callable[[], AbstractContextManager[CameraCase]]] = {
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
