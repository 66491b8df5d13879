"""The contract of `robot.testing`, for each of our drivers.

`CASES` maps a plugin's name to a context manager that yields a case, or skips with a reason.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Any

import pytest

from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.gpio.driver import GpioOptions
from robot.bodies.gymnasium.driver import GymnasiumDriver, GymnasiumOptions
from robot.devices.plugins import DRIVERS
from robot.exchange.replay_driver import ReplayDriver
from robot.simulator.driver import SimDriver, SimOptions
from robot.testing import VirtualClock
from robot.testing.cases import DriverCase
from robot.testing.driver_contract import DriverContract
from robot.types import Action, Point
from tests.faults.bodies import BODIES, pass_time
from tests.own_plugins import own_plugins


def as_point(wheels: tuple[float, float]) -> Point:
    """Return how a body turns and drives if its left and right wheel have these speeds."""
    left, right = wheels
    return Point(left - right, left + right)


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


BOX = "left=-0.6,0.1; right=0.6,0.1; forward=0,0.3; backward=0,-0.5"


def line_of_pixels(moves: str = "") -> GymnasiumDriver:
    pytest.importorskip("gymnasium", reason="the extra gymnasium is not installed")
    line, form = "tests.standins.gymnasium_line:Line", "box" if moves else "discrete"
    return GymnasiumDriver(
        GymnasiumOptions(env=line, env_options=f"width=101,form={form}", env_moves=moves)
    )


@contextmanager
def gymnasium_driver(moves: str = "") -> Iterator[DriverCase]:
    driver = line_of_pixels(moves)

    def is_moving() -> bool:
        driver.advance(0.0)
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


def real_brick_case(address: str) -> DriverCase:
    """A real brick, which `pytest --ev3 ADDRESS` names; it counts as moving while its wheels'
    counters change."""
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
    with timed_driver("ev3-remote") as case:
        yield case


@contextmanager
def timed_driver(name: str) -> Iterator[DriverCase]:
    """A body of tests/faults/bodies.py: the real driver and firmware on one virtual clock."""
    with BODIES[name][0](1) as body:
        body.slow_down(0.02)

        def is_moving() -> bool:
            if name in ("ros", "ev3", "ev3-remote"):
                body.clock.sleep(0.03)  # until the order has arrived
            return body.is_moving()

        def drives() -> Point:
            is_moving()
            assert body.wheels is not None
            return as_point(body.wheels())

        yield DriverCase(
            body.driver,
            partial(pass_time, body) if name == "lego-education" else body.clock.sleep,
            is_moving,
            body.lose,
            body.clock.now_s,
            restore_link=body.regain,
            drives=drives,
        )
        body.driver.disconnect()


@contextmanager
def gpio_driver(motor_board: str = "two-pwm") -> Iterator[DriverCase]:
    pytest.importorskip("gpiozero", reason="the extra gpio is not installed")
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
def replay_driver() -> Iterator[DriverCase]:
    clock = VirtualClock()
    driver = ReplayDriver(clock=clock)
    yield DriverCase(
        driver, clock.advance, lambda: driver.action is not Action.STOP, now_s=clock.now_s
    )


CASES: dict[str, Callable[[], AbstractContextManager[DriverCase]]] = {
    "sim": sim_driver,
    "replay": replay_driver,
    "ev3-remote": ev3_remote_driver,
    **{
        name: partial(timed_driver, name)
        for name in ("ev3", "ev3-stock", "lego-education", "pybricks", "ros", "udp", "ws")
    },
    "gpio": gpio_driver,
    "gpio, a car": partial(gpio_driver, "servo-esc"),
    "gpio, phase-enable": partial(gpio_driver, "phase-enable"),
    "gymnasium": gymnasium_driver,
    "gymnasium, a box": partial(gymnasium_driver, BOX),
}


def test_no_driver_is_left_out() -> None:
    missing = set(own_plugins(DRIVERS)) - set(CASES)
    assert not missing, f"CASES has no case for {missing}"


@pytest.fixture(params=sorted(CASES))
def driver_case(request: pytest.FixtureRequest) -> Iterator[DriverCase]:
    with CASES[request.param]() as built:
        yield built
        built.driver.disconnect()


class TestEveryDriver(DriverContract):
    pass
