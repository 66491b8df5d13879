"""The wheel speeds at each steering and throttle, and the pose that results from wheel speeds."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from typing import Any
from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.ev3.driver import ChassisDriver, ChassisOptions, wheels_of
from robot.devkit.dead_reckoning import DeadReckoning, along
from robot.devkit.wheels import CLASSIC_POINTS, TwoWheels
from robot.driver import ACTION_TIMEOUT_S, Pose
from robot.errors import DriveError
from robot.simulator.body import TRACK_M, WHEELS_MPS, move
from robot.types import Action, Point
from tests.kit.sizes import crossed, seeds

SHARES = st.floats(-1.0, 1.0).map(lambda share: round(share, 3))
POINTS = st.builds(Point, SHARES, SHARES)
SPEEDS = st.integers(1, 100).map(float)
BUILDS = st.builds(
    lambda ahead, back, turn, inner, spin: TwoWheels(
        ahead=ahead, back=back, turn=(turn - 2 * inner * turn, turn), spin=spin
    ),
    *[SPEEDS] * 3,
    st.sampled_from([0.5, 1.0]),
    SPEEDS,
)


@given(BUILDS)
def test_the_point_of_a_move_gives_the_wheel_speeds_of_the_move(wheels: TwoWheels) -> None:
    speeds = {move: wheels.at(point) for move, point in CLASSIC_POINTS.items()}
    left, right = wheels.turn
    assert speeds == {
        Action.STOP: (0, 0),
        Action.FORWARD: (wheels.ahead, wheels.ahead),
        Action.BACKWARD: (-wheels.back, -wheels.back),
        Action.LEFT: (left, right),
        Action.RIGHT: (right, left),
        Action.SPIN_LEFT: (-wheels.spin, wheels.spin),
        Action.SPIN_RIGHT: (wheels.spin, -wheels.spin),
    }


@given(BUILDS, POINTS, SHARES)
def test_more_steering_turns_more_to_the_wanted_side(
    wheels: TwoWheels, point: Point, steering: float
) -> None:
    def turn(at: Point) -> float:
        left, right = wheels.at(at)
        return left - right

    mirrored = wheels.at(Point(-point.steering, point.throttle))
    assert mirrored == wheels.at(point)[::-1]
    ahead = Point(point.steering, abs(point.throttle))
    assert turn(ahead) * point.steering >= 0.0
    other = Point(steering, ahead.throttle)
    assert (turn(other) - turn(ahead)) * (steering - point.steering) >= -1e-9


@given(BUILDS, POINTS, st.tuples(SPEEDS, SPEEDS))
def test_no_wheel_exceeds_its_top_speed_and_the_curve_stays_the_same(
    wheels: TwoWheels, point: Point, most: tuple[float, float]
) -> None:
    asked, given_ = wheels.at(point), wheels.at(point, most)
    assert all(abs(speed) <= top * (1 + 1e-9) for speed, top in zip(given_, most, strict=True))
    assert given_[0] * asked[1] == pytest.approx(given_[1] * asked[0])
    if all(abs(speed) <= top for speed, top in zip(asked, most, strict=True)):
        assert given_ == asked


TICK_S = 1 / 30
START = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0)


@crossed(counts=[True, False], seed=seeds(4, 10))
def test_without_slip_the_estimate_equals_the_true_path(seed: int, counts: bool) -> None:
    chance = random.Random(seed)
    reckoning, truth = DeadReckoning(TRACK_M), START
    wheels_m = (chance.uniform(-9, 9), chance.uniform(-9, 9))  # counts may begin at any value
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
    for tick in range(3):
        reckoning.tell(WHEELS_MPS[Action.FORWARD], tick * TICK_S)
        pose = reckoning.locate((1.0, 1.0), (tick + 1) * TICK_S)
    assert pose == replace(START, is_estimate=True)


def test_orders_between_two_readings_count_each_for_its_time() -> None:
    """Sensors are read less often than orders are sent, and an order ends if it is not renewed."""
    reckoning = DeadReckoning(TRACK_M)
    for order, now_s in ((Action.FORWARD, 0.0), (Action.BACKWARD, 0.1), (Action.FORWARD, 0.3)):
        reckoning.tell(WHEELS_MPS[order], now_s)
    ahead_mps, back_mps = WHEELS_MPS[Action.FORWARD][0], WHEELS_MPS[Action.BACKWARD][0]
    wanted_m = 0.1 * ahead_mps + 0.2 * back_mps + ACTION_TIMEOUT_S * ahead_mps
    assert reckoning.locate(None, 60.0).x_m == pytest.approx(wanted_m)
    reckoning.tell((0.0, 0.0), 61.0)
    assert reckoning.locate(None, 62.0).x_m == pytest.approx(wanted_m)


class _Chassis(ChassisDriver):
    """A chassis whose motors count in degrees."""

    name = "chassis"
    options_type = ChassisOptions
    turned_deg: tuple[float, float] | None = (0.0, 0.0)

    def _open(self) -> Any:
        told = {"distance_m": 1.0, "bumped": None, "bumpers": []}
        return mock.Mock(
            open=lambda: [1050.0, 1050.0], sense=lambda: {**told, "wheels_deg": self.turned_deg}
        )


@pytest.mark.parametrize("reversed_motors", [False, True])
def test_a_chassis_counts_the_distance_that_its_wheels_roll(reversed_motors: bool) -> None:
    with _Chassis(ChassisOptions(reversed_motors=reversed_motors)) as driver:
        assert driver.sense().pose == replace(START, is_estimate=True)
        dps = wheels_of(driver.options).at(CLASSIC_POINTS[Action.LEFT])
        driver.turned_deg = 0.2 * dps[0], 0.2 * dps[1]
        after = driver.sense().pose
        left_m, right_m = (0.2 * mps for mps in driver.wheels_mps(Action.LEFT))
        turned_rad = (right_m - left_m) / driver.options.track_m
        truth = along(START, turned_rad, (left_m + right_m) / 2)
        assert after is not None
        assert (after.x_m, after.y_m) == pytest.approx((truth.x_m, truth.y_m))
        driver.turned_deg = None  # this agent sends no angles, so the orders determine the motion
        driver.drive(Action.LEFT, speed_scale=0.5)
        assert driver.sense().pose is not None
    assert driver.wheels_mps(Action.FORWARD) == pytest.approx((0.16, 0.16))


def test_motors_that_do_not_answer_affect_only_the_estimate(monkeypatch: Any) -> None:
    from robot.bodies.ev3.agent.body import BrickBody

    body = BrickBody(ChassisOptions(ultrasonic_port="none", touch_port="none").ports())
    monkeypatch.setattr(body.sensors, "read", lambda: {"distance_m": 0.5})

    def refuse() -> list[float]:
        raise DriveError("the motors do not answer")

    monkeypatch.setattr(body.motors, "positions", refuse)
    assert body.sense() == {"distance_m": 0.5, "wheels_deg": None}
