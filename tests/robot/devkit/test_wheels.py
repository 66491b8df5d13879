"""From a point to two wheels: the moves at the corners, and monotonic speeds between them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.devkit.wheels import CLASSIC_POINTS, TwoWheels
from robot.types import Action, Point

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
def test_no_wheel_is_asked_for_more_than_it_can_and_the_curve_stays(
    wheels: TwoWheels, point: Point, most: tuple[float, float]
) -> None:
    asked, given_ = wheels.at(point), wheels.at(point, most)
    assert all(abs(speed) <= top * (1 + 1e-9) for speed, top in zip(given_, most, strict=True))
    assert given_[0] * asked[1] == pytest.approx(given_[1] * asked[0])
    if all(abs(speed) <= top for speed, top in zip(asked, most, strict=True)):
        assert given_ == asked
