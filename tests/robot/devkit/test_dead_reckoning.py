"""The estimate of a robot's pose, compared with a simulated body that knows the true pose."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from typing import Any

import pytest

from robot.bodies.ev3.driver import ChassisDriver, ChassisOptions, wheels_of
from robot.devkit.dead_reckoning import DeadReckoning, along
from robot.devkit.wheels import CLASSIC_POINTS
from robot.driver import ACTION_TIMEOUT_S, Driver
from robot.errors import DriveError
from robot.simulator.body import TRACK_M, WHEELS_MPS, move
from robot.types import Action, Pose
from tests.kit.sizes import crossed, seeds

TICK_S = 1 / 30
START = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0)


@crossed(counts=[True, False], seed=seeds(4, 10))
def test_without_slip_the_estimate_is_the_truth(seed: int, counts: bool) -> None:
    chance = random.Random(seed)
    reckoning, truth = DeadReckoning(TRACK_M), START
    wheels_m = (chance.uniform(-9, 9), chance.uniform(-9, 9))  # counts begin anywhere
    now_s = 100.0
    pose = reckoning.locate(wheels_m if counts else None, now_s)
    assert pose == replace(START, is_estimate=True)
    for _ in range(30):
        action, scale = chance.choice(list(WHEELS_MPS)), chance.choice([1.0, 0.5])
        for _ in range(chance.randint(1, 30)):
            left, right = (speed * scale for speed in WHEELS_MPS[action])
            reckoning.tell((left, right), now_s)
            truth = move(truth, left, right, TICK_S)
            wheels_m = wheels_m[0] + left * TICK_S, wheels_m[1] + right * TICK_S
            now_s += TICK_S
            pose = reckoning.locate(wheels_m if counts else None, now_s)
    assert pose.is_estimate
    assert math.hypot(pose.x_m - truth.x_m, pose.y_m - truth.y_m) < 1e-6
    turned = math.remainder(pose.heading_rad - truth.heading_rad, math.tau)
    assert abs(turned) < 1e-6


def test_wheel_counts_show_that_wheels_were_blocked() -> None:
    reckoning = DeadReckoning(TRACK_M)
    for tick in range(30):
        reckoning.tell(WHEELS_MPS[Action.FORWARD], tick * TICK_S)
        pose = reckoning.locate((1.0, 1.0), (tick + 1) * TICK_S)
    assert pose == replace(START, is_estimate=True)


def test_orders_between_two_readings_count_each_for_its_time() -> None:
    """Sensors are read less often than orders are sent; an order that is not renewed ends."""
    reckoning = DeadReckoning(TRACK_M)
    for order, now_s in ((Action.FORWARD, 0.0), (Action.BACKWARD, 0.1), (Action.FORWARD, 0.3)):
        reckoning.tell(WHEELS_MPS[order], now_s)
    ahead_mps, back_mps = WHEELS_MPS[Action.FORWARD][0], WHEELS_MPS[Action.BACKWARD][0]
    wanted_m = 0.1 * ahead_mps + 0.2 * back_mps + ACTION_TIMEOUT_S * ahead_mps
    assert reckoning.locate(None, 60.0).x_m == pytest.approx(wanted_m)
    reckoning.tell((0.0, 0.0), 61.0)
    assert reckoning.locate(None, 62.0).x_m == pytest.approx(wanted_m)


class _CountingBody:
    """A chassis whose motors count in degrees, mounted in either direction."""

    def __init__(self) -> None:
        self.turned_deg: list[float] | None = [0.0, 0.0]

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None

    def open(self) -> list[float]:
        return [1050.0, 1050.0]

    def sense(self) -> dict[str, Any]:
        return {"distance_m": 1.0, "bumped": None, "bumpers": [], "wheels_deg": self.turned_deg}


class _Chassis(ChassisDriver):
    name = "chassis"
    options_type = ChassisOptions

    def __init__(self, options: ChassisOptions) -> None:
        super().__init__(options)
        self.body = _CountingBody()

    def _open(self) -> Any:
        return self.body


@crossed(reversed_motors=[False, True], action=[Action.FORWARD, Action.LEFT, Action.BACKWARD])
def test_a_chassis_counts_the_way_of_its_wheels(action: Action, reversed_motors: bool) -> None:
    driver = _Chassis(ChassisOptions(reversed_motors=reversed_motors))
    assert isinstance(driver, Driver)
    with driver:
        assert driver.sense().pose == replace(START, is_estimate=True)
        dps = wheels_of(driver.options).at(CLASSIC_POINTS[action])
        driver.body.turned_deg = [0.2 * dps[0], 0.2 * dps[1]]
        after = driver.sense().pose
        left_m, right_m = (0.2 * mps for mps in driver.wheels_mps(action))
        turned_rad = (right_m - left_m) / driver.options.track_m
        truth = along(START, turned_rad, (left_m + right_m) / 2)
        assert after is not None
        assert (after.x_m, after.y_m) == pytest.approx((truth.x_m, truth.y_m))
        driver.body.turned_deg = None  # an agent that sends none: the orders count
        driver.drive(action, speed_scale=0.5)
        assert driver.sense().pose is not None
    if action is Action.FORWARD:
        assert driver.wheels_mps(action) == pytest.approx((0.16, 0.16))


def test_motors_that_do_not_answer_affect_only_the_estimate(monkeypatch: Any) -> None:
    from robot.bodies.ev3.agent.body import BrickBody

    body = BrickBody(ChassisOptions(ultrasonic_port="none", touch_port="none").ports())
    monkeypatch.setattr(body.sensors, "read", lambda: {"distance_m": 0.5})

    def refuse() -> list[float]:
        raise DriveError("the motors do not answer")

    monkeypatch.setattr(body.motors, "positions", refuse)
    assert body.sense() == {"distance_m": 0.5, "wheels_deg": None}
