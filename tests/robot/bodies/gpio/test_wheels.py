"""The motors' logic in virtual time: each move ends, once, and never late."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.gpio.driver import GpioOptions
from robot.bodies.gpio.wheels import Build, TimedMotors, steered, tracked
from robot.errors import ConfigurationError
from robot.moves import CLASSIC

SHARES = {
    "forward": (1, 1),
    "left": (0, 1),
    "right": (1, 0),
    "backward": (-1, -1),
    "spin_left": (-1, 1),
    "spin_right": (1, -1),
}
NUMBERS = st.one_of(st.floats(-1, 1), st.floats())
ORDERS = st.tuples(
    st.sampled_from(["stop", "dance", *CLASSIC]),
    st.integers(-10, 5000),
    st.floats(-1, 2, allow_subnormal=False),  # half of the smallest float is 0
    st.integers(0, 40),
    st.integers(-100, 1500),
    st.just(()) | st.tuples(NUMBERS, NUMBERS),
)


class Motor:
    value = 0.3


CARS = ("servo_ends", "esc_pin", "servo_pin")
TRACKED = tracked(0.6, 0.4)
CAR = steered(0.6, 0.4, (0.9, -0.7))


def made(build: Build = TRACKED, bumped: bool = False) -> tuple[TimedMotors, list[Motor]]:
    motors = [Motor(), Motor()]
    return TimedMotors(motors, build, lambda: bumped), motors


@given(
    st.lists(st.tuples(ORDERS, st.integers(0, 700)), max_size=30), st.sampled_from([TRACKED, CAR])
)
def test_each_move_ends_in_time_whatever_orders_come(
    sent: list[tuple[tuple, int]], build: Build
) -> None:
    wheels, motors = made(build)
    turning = motors if build is TRACKED else motors[:1]
    now_ms, moved_ms, highest = 10_000, -1000, 0
    for (move, for_ms, speed, seq, behind_ms, point), pause_ms in sent:
        words = (move, for_ms, speed, seq, now_ms - behind_ms, *point)
        report = wheels.obey(" ".join(map(str, words)).encode(), now_ms)
        is_sound = move != "dance" and for_ms > 0 and 0 < speed <= 1
        if is_sound and seq > highest and all(-1 <= number <= 1 for number in point):
            highest = seq
            may_move = move != "stop" and behind_ms < 500
            moved_ms = now_ms - behind_ms if may_move else -1000
            assert may_move or not any(motor.value for motor in turning)
            if may_move and not point and (build is TRACKED or "spin" not in move):
                assert any(motor.value for motor in turning)
        assert (report.seq, report.ms) == (highest, now_ms)
        for _ in range(pause_ms):  # the keeper checks the time when `left_ms` requires it
            now_ms += 1
            if wheels.left_ms(now_ms) == 0:
                wheels.tick(now_ms)
            if any(motor.value for motor in turning):
                assert now_ms - moved_ms < 500, "counted from what its sender had seen"
        assert all(abs(motor.value) <= 1 for motor in motors)
        assert point or all(abs(motor.value) <= 0.6 for motor in turning)


def test_each_move_turns_the_right_wheels() -> None:
    wheels, motors = made(bumped=True)
    assert [motor.value for motor in motors] == [0, 0], "it begins by standing"
    for seq, (move, (left, right)) in enumerate(SHARES.items(), 1):
        report = wheels.obey(f"{move} 400 0.5 {seq} 0".encode(), 0)
        full = 0.6 if left == right else 0.4
        assert [motor.value for motor in motors] == [0.5 * full * left, 0.5 * full * right]
        assert report.sensors.bumped is True


@pytest.mark.parametrize(
    ("order", "throttle", "steering"),
    [
        ("stop 400 1 1 0", 0.0, 0.1),
        ("forward 400 1 1 0", 0.6, 0.1),
        ("left 400 0.5 1 0", 0.2, 0.9),
        ("right 400 1 1 0 0.5 0.25", 0.25, -0.3),
        ("backward 400 1 1 0 -1 -0.5", -0.4, 0.9),
        ("forward 400 1 1 0 0 1", 1.0, 0.1),
    ],
)
def test_a_car_is_steered_by_its_servo(order: str, throttle: float, steering: float) -> None:
    """The servo's ends are .9 at the left and -.7 at the right, so .1 is straight."""
    car, motors = made(CAR)
    assert [motor.value for motor in motors] == pytest.approx([0.0, 0.1])
    car.obey(order.encode(), 0)
    assert [motor.value for motor in motors] == pytest.approx([throttle, steering])


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("left_pins", "17"),
        ("left_pins", "17,99"),
        ("right_pins", "a,b"),
        ("bumper_pin", "1,2"),
        ("bumper_pin", "17"),
        ("right_pins", "17,23"),
        ("straight_speed", 0.0),
        ("turn_speed", 1.5),
        ("servo_ends", "1"),
        ("servo_ends", "1,1"),
        ("servo_ends", "nan,1"),
        ("servo_ends", "-1.1,1"),
        ("esc_pin", "12"),
        ("servo_pin", "12,13"),
    ],
)
def test_bad_options_are_refused_with_their_name(option: str, value: object) -> None:
    with pytest.raises(ConfigurationError, match="--" + option.replace("_", "-")):
        GpioOptions(**{"motor_board": "servo-esc" if option in CARS else "two-pwm", option: value})
