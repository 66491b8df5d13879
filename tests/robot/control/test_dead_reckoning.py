"""The estimate of a robot's place, held against a simulated body that knows the truth."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from typing import Any

import pytest

from robot.bodies.ev3.driver import ChassisDriver, ChassisOptions, wheels_of
from robot.control.dead_reckoning import DeadReckoning
from robot.control.state import Tick
from robot.devkit.wheels import CLASSIC_POINTS
from robot.driver import ACTION_TIMEOUT_S, Driver
from robot.errors import DriveError
from robot.simulator.body import TRACK_M, WHEELS_MPS, move
from robot.testing import FakeDriver
from robot.types import Action, Decision, DrivenBy, Mode, Point, Pose, Sensors
from tests.kit.sizes import crossed, seeds

TICK_S = 1 / 30
START = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0)


class _TwoWheels(FakeDriver):
    """A body whose wheels are the simulation's."""

    track_m = TRACK_M

    def wheels_mps(self, action: Action, point: Point | None = None) -> tuple[float, float]:
        return WHEELS_MPS[action]


def told(action: Action, now_s: float, scale: float = 1.0) -> Tick:
    """A tick in which the motors were told this."""
    decision = Decision(action=action, driven_by=DrivenBy.PILOT, mode=Mode.TRAIN, speed_scale=scale)
    return Tick(now_s=now_s, decision=decision, sent=action)


@crossed(counts=[True, False], seed=seeds(4, 10))
def test_without_slip_the_estimate_is_the_truth(seed: int, counts: bool) -> None:
    chance = random.Random(seed)
    reckoning, truth = DeadReckoning(_TwoWheels()), START
    wheels_m = (chance.uniform(-9, 9), chance.uniform(-9, 9))  # counts begin anywhere
    now_s = 100.0
    reading = Sensors(wheels_m=wheels_m if counts else None)
    sensed = reckoning.locate(reading, told(Action.STOP, now_s), now_s)
    assert sensed.pose == replace(START, is_estimate=True)
    for _ in range(30):
        action, scale = chance.choice(list(WHEELS_MPS)), chance.choice([1.0, 0.5])
        for _ in range(chance.randint(1, 30)):
            last = told(action, now_s, scale)
            left, right = (speed * scale for speed in WHEELS_MPS[action])
            truth = move(truth, left, right, TICK_S)
            wheels_m = wheels_m[0] + left * TICK_S, wheels_m[1] + right * TICK_S
            now_s += TICK_S
            reading = Sensors(wheels_m=wheels_m if counts else None)
            sensed = reckoning.locate(reading, last, now_s)
    assert sensed.pose is not None and sensed.pose.is_estimate
    assert math.hypot(sensed.pose.x_m - truth.x_m, sensed.pose.y_m - truth.y_m) < 1e-6
    turned = math.remainder(sensed.pose.heading_rad - truth.heading_rad, math.tau)
    assert abs(turned) < 1e-6


def test_counts_know_of_wheels_that_were_held() -> None:
    reckoning = DeadReckoning(_TwoWheels())
    for tick in range(30):
        last = told(Action.FORWARD, (tick - 1) * TICK_S)
        sensed = reckoning.locate(Sensors(wheels_m=(1.0, 1.0)), last, tick * TICK_S)
    assert sensed.pose == replace(START, is_estimate=True)


def test_a_move_that_is_not_renewed_ends_in_the_estimate_too() -> None:
    reckoning = DeadReckoning(_TwoWheels())
    pose = reckoning.locate(Sensors(), told(Action.FORWARD, 0.0), 60.0).pose
    assert pose is not None
    assert pose.x_m == pytest.approx(WHEELS_MPS[Action.FORWARD][0] * ACTION_TIMEOUT_S)


def test_the_truth_stays_the_truth_and_what_nobody_knows_is_not_made_up() -> None:
    there = Sensors(pose=Pose(x_m=3.0, y_m=4.0, heading_rad=1.0))
    last = told(Action.FORWARD, 0.9)
    assert DeadReckoning(_TwoWheels()).locate(there, last, 1.0) is there
    assert DeadReckoning(FakeDriver()).locate(Sensors(), last, 1.0).pose is None


class _CountingBody:
    """A chassis whose motors count in degrees, mounted either way round."""

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
        before = driver.sense().wheels_m
        dps = wheels_of(driver.options).at(CLASSIC_POINTS[action])
        driver.body.turned_deg = [2.0 * dps[0], 2.0 * dps[1]]
        after = driver.sense().wheels_m
        assert before == (0.0, 0.0) and after is not None
        assert after == pytest.approx([2.0 * mps for mps in driver.wheels_mps(action)])
        driver.body.turned_deg = None  # an agent that sends none
        assert driver.sense().wheels_m is None
    if action is Action.FORWARD:
        assert driver.wheels_mps(action) == pytest.approx((0.16, 0.16))


def test_motors_that_do_not_answer_cost_the_estimate_alone(monkeypatch: Any) -> None:
    from robot.bodies.ev3.agent.body import BrickBody

    body = BrickBody(ChassisOptions(ultrasonic_port="none", touch_port="none").ports())
    monkeypatch.setattr(body.sensors, "read", lambda: {"distance_m": 0.5})

    def refuse() -> list[float]:
        raise DriveError("the motors do not answer")

    monkeypatch.setattr(body.motors, "positions", refuse)
    assert body.sense() == {"distance_m": 0.5, "wheels_deg": None}
