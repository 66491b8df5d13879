"""The motors' part, in made-up time: whatever comes, each move ends, once, and never late."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.gpio.driver import GpioOptions
from robot.bodies.gpio.wheels import SHARES, TimedWheels
from robot.errors import ConfigurationError

ORDERS = st.builds(
    lambda move, for_ms, speed, seq, behind_ms: (move, for_ms, speed, seq, behind_ms),
    st.sampled_from(["stop", "dance", *SHARES]),
    st.integers(-10, 5000),
    st.floats(-1, 2, allow_subnormal=False),  # half of the smallest is nothing
    st.integers(0, 40),
    st.integers(-100, 1500),
)


class Motor:
    value = 0.3


def made(bumped: bool = False) -> tuple[TimedWheels, list[Motor]]:
    motors = [Motor(), Motor()]
    return TimedWheels(motors[0], motors[1], 0.6, 0.4, lambda: bumped), motors


@given(st.lists(st.tuples(ORDERS, st.integers(0, 700)), max_size=30))
def test_whatever_comes_each_move_ends_in_time(sent: list[tuple[tuple, int]]) -> None:
    wheels, motors = made()
    now_ms, moved_ms, highest = 10_000, -1000, 0
    assert [motor.value for motor in motors] == [0, 0], "it begins by standing"
    for (move, for_ms, speed, seq, behind_ms), pause_ms in sent:
        report = wheels.obey(f"{move} {for_ms} {speed} {seq} {now_ms - behind_ms}".encode(), now_ms)
        is_sound = move != "dance" and for_ms > 0 and 0 < speed <= 1
        if is_sound and seq > highest:
            highest = seq
            is_moving = move != "stop" and behind_ms < 500
            moved_ms = now_ms - behind_ms if is_moving else -1000
            assert any(motor.value for motor in motors) == is_moving
        assert (report.seq, report.ms) == (highest, now_ms)
        for _ in range(pause_ms):  # the keeper looks whenever `left_ms` says that it must
            now_ms += 1
            if wheels.left_ms(now_ms) == 0:
                wheels.tick(now_ms)
            if any(motor.value for motor in motors):
                assert now_ms - moved_ms < 500, "counted from what its sender had seen"
        assert all(abs(motor.value) <= 0.6 for motor in motors)


def test_moves_turn_the_wheels_as_they_say() -> None:
    wheels, motors = made(bumped=True)
    for seq, (move, (left, right)) in enumerate(SHARES.items(), 1):
        report = wheels.obey(f"{move} 400 0.5 {seq} 0".encode(), 0)
        full = 0.6 if left == right else 0.4
        assert [motor.value for motor in motors] == [0.5 * full * left, 0.5 * full * right]
        assert report.sensors.bumped is True


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
    ],
)
def test_bad_options_are_refused_with_their_name(option: str, value: object) -> None:
    with pytest.raises(ConfigurationError, match="--" + option.replace("_", "-")):
        GpioOptions(**{option: value})
