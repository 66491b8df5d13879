"""Real sockets, processes and third-party libraries also keep the contract.

These tests check only that the parts work. The suites in virtual time check the times of every
body.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace

import pytest

from robot.bodies.ev3.stock_driver import Ev3StockDriver, Ev3StockOptions
from robot.bodies.lego_education.driver import LegoEducationDriver, LegoEducationOptions
from robot.bodies.mjpeg.camera import MjpegCamera, MjpegOptions
from robot.bodies.pybricks.driver import PybricksOptions
from robot.bodies.remote.driver import RemoteOptions, ReportingDriver
from robot.bodies.remote.udp import UdpDriver
from robot.bodies.remote.ws import WsDriver
from robot.bodies.ros.camera import RosCamera, RosCameraOptions
from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.clock import RealClock
from robot.driver import Driver
from robot.testing.camera_contract import CameraContract
from robot.testing.cases import CameraCase, DriverCase
from robot.testing.driver_contract import DriverContract
from robot.types import Point
from tests.contract.driver_cases import DRIVERS
from tests.kit.sizes import IS_FULL
from tests.standins.ev3_stock import StockBrick
from tests.standins.firmware import SECRET as SECRET_OF_FIRMWARE
from tests.standins.firmware import FirmwareRobot, Relay
from tests.standins.lego_education import FakeDoubleMotor
from tests.standins.mjpeg import MjpegServer
from tests.standins.pybricks_hub import FakeHub
from tests.standins.rosbridge import RosBridgeServer
from tests.standins.ws_robot import WsRobot

_ASKED_AT_MOST = 20
"""A body that sends nothing after its connection was cut."""


def on_a_busy_machine(
    driver: Driver, is_moving: Callable[[], bool], cut_link: Callable[[], None]
) -> DriverCase:
    """Return a case over real sockets, without checks of its speed."""
    return DriverCase(driver, time.sleep, is_moving, cut_link, budget_s=5.0)


def one_that_reports(
    driver: ReportingDriver, is_moving: Callable[[], bool], cut_link: Callable[[], None]
) -> DriverCase:
    """Return a case for a body that reports the last order that it obeyed; only motion after this
    report counts."""

    def moves_now() -> bool:
        for _ in range(_ASKED_AT_MOST):
            report = driver._report
            if report is None or report.seq >= driver._seq:
                break
            driver._exchange(driver.hello)
        return is_moving()

    return on_a_busy_machine(driver, moves_now, cut_link)


@contextmanager
def ev3_stock_driver() -> Iterator[DriverCase]:
    with StockBrick() as brick:
        options = Ev3StockOptions(line="wifi", beacon_port=brick.beacon_port)
        driver = Ev3StockDriver(options)
        yield on_a_busy_machine(driver, lambda: brick.is_moving, brick.frozen.set)
        driver.disconnect()


@contextmanager
def udp_driver() -> Iterator[DriverCase]:
    with FirmwareRobot() as robot, Relay(robot.port) as line:
        driver = UdpDriver(RemoteOptions(address=line.address, secret=SECRET_OF_FIRMWARE))
        yield one_that_reports(driver, robot.is_moving, line.is_cut.set)
        driver.disconnect()


@contextmanager
def ws_driver() -> Iterator[DriverCase]:
    with WsRobot("secret") as robot:
        driver = WsDriver(RemoteOptions(address=robot.address, secret="secret"))
        yield one_that_reports(driver, lambda: robot.is_moving, robot.silent.set)
        driver.disconnect()


@contextmanager
def pybricks_driver() -> Iterator[DriverCase]:
    with FakeHub() as hub:
        driver = hub.driver(PybricksOptions())
        yield one_that_reports(driver, lambda: hub.is_moving, hub.cut)
        driver.disconnect()


@contextmanager
def lego_education_driver() -> Iterator[DriverCase]:
    with FakeDoubleMotor() as motor:
        driver = LegoEducationDriver(LegoEducationOptions(), library=motor.library)
        yield on_a_busy_machine(driver, lambda: motor.is_moving, motor.cut)
        driver.disconnect()


@contextmanager
def ros_driver() -> Iterator[DriverCase]:
    """A base that never stops by itself, behind our watchdog."""
    with RosBridgeServer() as ros, ros.watchdog():
        driver = RosDriver(RosOptions(address=ros.address, watchdog=True))

        def drives() -> Point:
            ros.settle(driver._connection)
            return ros.drives

        case = on_a_busy_machine(driver, lambda: any(drives()), ros.frozen.set)
        yield replace(case, restore_link=ros.frozen.clear, drives=drives)
        driver.disconnect()


@contextmanager
def dds_driver() -> Iterator[DriverCase]:
    """A ROS base over DDS that never stops by itself, behind our watchdog; the robot is another
    participant."""
    from tests.standins.dds_robot import DdsRobot, own_domain

    domain = own_domain()
    with DdsRobot(domain) as robot:
        options = RosOptions(transport="dds", address="127.0.0.1", domain=domain, watchdog=True)
        driver = RosDriver(options)

        def drives() -> Point:
            time.sleep(0.05)  # no DDS message confirms that all earlier ones were received
            return robot.drives

        case = on_a_busy_machine(driver, lambda: any(drives()), robot.frozen.set)
        yield replace(case, restore_link=robot.frozen.clear, drives=drives)
        driver.disconnect()


@contextmanager
def dds_camera() -> Iterator[CameraCase]:
    from tests.standins.dds_robot import DdsRobot, own_domain

    domain = own_domain()
    with DdsRobot(domain) as robot:
        options = RosCameraOptions(transport="dds", address="127.0.0.1", domain=domain)
        camera = RosCamera(options, RealClock())
        yield CameraCase(camera, robot.frozen.set, robot.frozen.clear)


@contextmanager
def ros_camera() -> Iterator[CameraCase]:
    with RosBridgeServer() as ros:
        camera = RosCamera(RosCameraOptions(address=ros.address), RealClock())
        yield CameraCase(camera, ros.frozen.set, ros.frozen.clear)


@contextmanager
def mjpeg_camera() -> Iterator[CameraCase]:
    with MjpegServer() as server:
        camera = MjpegCamera(MjpegOptions(source=server.address), RealClock())
        yield CameraCase(camera, server.frozen.set, server.frozen.clear)


REAL_DRIVERS: dict[str, Callable[[], AbstractContextManager[DriverCase]]] = {
    "ev3-stock": ev3_stock_driver,
    "lego-education": lego_education_driver,
    "pybricks": pybricks_driver,
    "ros": ros_driver,
    "ros over DDS": dds_driver,
    "udp": udp_driver,
    "ws": ws_driver,
}
REAL_CAMERAS: dict[str, Callable[[], AbstractContextManager[CameraCase]]] = {
    "mjpeg": mjpeg_camera,
    "ros": ros_camera,
    "ros over DDS": dds_camera,
}
SMOKE = (
    DriverContract.test_every_move_moves_and_stop_stops,
    DriverContract.test_it_leaves_nothing_behind,
    DriverContract.test_a_body_whose_line_is_cut_stands_and_the_driver_says_so,
)
"""Checks for real parts of bodies that keep the whole contract in virtual time."""
CAMERA_SMOKE = (
    CameraContract.test_frames_count_up_and_are_stamped_by_the_clock,
    CameraContract.test_it_leaves_no_thread_behind,
    CameraContract.test_a_frozen_source_is_a_fault,
    CameraContract.test_a_source_that_was_frozen_is_seen_again,
)
WHOLE = tuple(check for name, check in vars(DriverContract).items() if name.startswith("test_"))


def check_driver_on_its_real_line(name: str) -> None:
    """Check a driver against the contract, in the one test that starts its real part."""
    is_short = name in DRIVERS or (name == "ros over DDS" and not IS_FULL)
    for check in SMOKE if is_short else WHOLE:
        # If a check does not apply to this body, the test must go on with the next check.
        with REAL_DRIVERS[name]() as case, contextlib.suppress(pytest.skip.Exception):
            check(DriverContract(), case)


def check_camera_on_its_real_line(name: str) -> None:
    """Check a camera against the contract, in the one test that starts its real part."""
    for check in CAMERA_SMOKE:
        with REAL_CAMERAS[name]() as case:
            check(CameraContract(), case)
            case.camera.stop()
