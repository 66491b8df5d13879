"""How the contract suites build each driver and camera that is installed here.

An entry maps a plugin's name to a context manager that yields a case, or skips with a reason.
A plugin without an entry fails the suite: nothing joins the registry untested.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

from robot.camera import Camera
from robot.cameras.sim import SimCamera, SimCameraOptions
from robot.clock import RealClock
from robot.driver import Driver
from robot.drivers.sim import SimDriver, SimOptions


@dataclass(frozen=True, slots=True)
class DriverCase:
    """A driver, and how a test lets time pass for it and asks whether the body moves."""

    driver: Driver
    forward: Callable[[float], None]
    is_moving: Callable[[], bool]


@dataclass(frozen=True, slots=True)
class CameraCase:
    """A camera, ready to start."""

    camera: Camera


@contextmanager
def sim_driver() -> Iterator[DriverCase]:
    driver = SimDriver(SimOptions(world="office"))

    def is_moving() -> bool:
        before = driver.simulation.pose
        driver.advance(0.02)
        return driver.simulation.pose != before

    yield DriverCase(driver, driver.advance, is_moving)


@contextmanager
def sim_camera() -> Iterator[CameraCase]:
    driver = SimDriver(SimOptions(world="office"))
    yield CameraCase(SimCamera(driver, SimCameraOptions(), RealClock()))


DRIVERS: dict[str, Callable[[], AbstractContextManager[DriverCase]]] = {"sim": sim_driver}
CAMERAS: dict[str, Callable[[], AbstractContextManager[CameraCase]]] = {"sim": sim_camera}
