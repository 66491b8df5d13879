"""The brick's body and the driver on it, on an EV3 made of files."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from robot.brick.chassis import ChassisOptions, wheel_speeds
from robot.driver import BodyButton
from robot.drivers.ev3 import Ev3Driver, Ev3Options
from robot.errors import ConfigurationError, DriveError, NotConnectedError
from robot.types import Action, Mode
from tests.brick.fake_brick import FakeBrick


def make_driver(brick: FakeBrick, **options: object) -> Ev3Driver:
    return Ev3Driver(Ev3Options(brick_root=str(brick.root), **options))  # type: ignore[arg-type]


def test_the_defaults_are_the_speeds_of_the_paper() -> None:
    options = ChassisOptions()
    assert wheel_speeds(Action.FORWARD, options) == pytest.approx((360, 360), rel=0.01)
    assert wheel_speeds(Action.LEFT, options) == pytest.approx((-90, 0), rel=0.01)
    assert wheel_speeds(Action.RIGHT, options) == pytest.approx((0, -90), rel=0.01)


@pytest.mark.parametrize("turn_by", ["backward", "forward", "both"])
def test_each_way_to_turn_turns_at_the_same_rate(turn_by: str) -> None:
    options = ChassisOptions(turn_by=turn_by)
    left, right = wheel_speeds(Action.LEFT, options)
    rim_m_per_deg = math.pi * options.wheel_diameter_m / 360
    assert (right - left) * rim_m_per_deg / options.track_m == pytest.approx(math.radians(18.5))
    assert wheel_speeds(Action.RIGHT, options) == (right, left)


def test_a_move_is_timed_and_ends_by_itself(brick: FakeBrick) -> None:
    with make_driver(brick) as driver:
        driver.send_action(Action.FORWARD)
        brick.wait_until(lambda: set(brick.speeds().values()) == {360})
        began_s = next(c.at_s for c in brick.commands if c.command == "run-timed")
        brick.wait_until(lambda: not brick.is_moving())
        assert 0.39 < time.monotonic() - began_s < 0.55
    moves = [c for c in brick.commands if c.command.startswith("run")]
    assert {(c.command, c.time_ms) for c in moves} == {("run-timed", 400)}


def test_a_turn_moves_one_wheel_and_stops_the_other(brick: FakeBrick) -> None:
    with make_driver(brick) as driver:
        driver.send_action(Action.FORWARD)
        brick.wait_until(brick.is_moving)
        driver.send_action(Action.LEFT, speed_scale=0.5)
        brick.wait_until(lambda: brick.speeds() == {"outB": -45, "outC": 0})
        driver.stop()
        driver.stop()
        brick.wait_until(lambda: not brick.is_moving(), 0.3)


def test_sensors_are_read_in_metres(brick: FakeBrick) -> None:
    brick.add_sensor("in4", "lego-ev3-us", 1234, decimals=1)
    brick.add_sensor("in1", "lego-ev3-touch", 0)
    with make_driver(brick, ultrasonic_port="in4") as driver:
        sensors = driver.sense()
        assert sensors.distance_m == pytest.approx(1.234)
        assert sensors.bumped is False
        assert sensors.battery_share == pytest.approx(0.5)
        brick.set_sensor("lego-ev3-touch", 1)
        assert driver.sense().bumped is True


def test_sensors_may_be_missing(brick: FakeBrick) -> None:
    with make_driver(brick) as driver:
        assert driver.sense().distance_m is None
        assert driver.sense().bumped is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"left_port": "outA"}, ["port outA", "--left-port", "lego-ev3-l-motor at ev3-ports:outB"]),
        ({"ultrasonic_port": "in2"}, ["port in2", "--ultrasonic-port", "found: nothing"]),
        ({"touch_port": "in3"}, ["port in3", "--touch-port"]),
    ],
)
def test_a_wrong_port_is_one_clear_line(
    brick: FakeBrick, options: dict[str, str], words: list[str]
) -> None:
    with pytest.raises(DriveError) as failure:
        make_driver(brick, **options).connect()
    assert all(word in str(failure.value) for word in words)
    assert "\n" not in str(failure.value)


def test_no_brick_at_all_is_one_clear_line(tmp_path: Path) -> None:
    driver = Ev3Driver(Ev3Options(brick_root=str(tmp_path)))
    with pytest.raises(DriveError, match=r"no left motor at port outB.*found: nothing"):
        driver.connect()
    with pytest.raises(NotConnectedError):
        driver.send_action(Action.FORWARD)
    driver.stop()
    driver.disconnect()


def test_a_motor_that_was_unplugged_is_found_again(brick: FakeBrick) -> None:
    with make_driver(brick) as driver:
        assert isinstance(driver._body.stop, object)  # type: ignore[union-attr]
        brick.unplug_motor("outC")
        # Open files outlive their folder here; on a brick the next write fails with ENODEV.
        for port in driver._body._motors:  # type: ignore[union-attr]
            for file in port._files.values():
                file.close()
        with pytest.raises(DriveError, match="outB and outC do not answer"):
            driver.send_action(Action.FORWARD)
        with pytest.raises(DriveError, match="no right motor at port outC"):
            driver.send_action(Action.FORWARD)
        brick.add_motor("outC")
        driver.send_action(Action.FORWARD)
        brick.wait_until(lambda: set(brick.speeds().values()) == {360})


def test_a_sensor_that_was_unplugged_is_said_and_found_again(brick: FakeBrick) -> None:
    brick.add_sensor("in1", "lego-ev3-touch", 0)
    with make_driver(brick) as driver:
        folder = brick.root / "sys/class/lego-sensor"
        driver._body._sensors["touch"]._files.clear()  # type: ignore[union-attr]
        folder.rename(brick.root / "unplugged")
        for _ in range(2):
            with pytest.raises(DriveError, match=r"touch sensor does not answer.*cable"):
                driver.sense()
        (brick.root / "unplugged").rename(folder)
        assert driver.sense().bumped is False


def test_buttons_lights_and_screen(brick: FakeBrick) -> None:
    driver = make_driver(brick)
    driver.announce("http://192.168.1.7:8000")
    with driver:
        assert "192.168.1.7" in brick.screen.read_text()
        assert (brick.light("led0:red:brick-status"), brick.light("led1:green:brick-status")) == (
            0,
            255,
        )
        assert driver.take_button() is None
        brick.press(28)
        assert driver.take_button() is BodyButton.START
        brick.press(28)
        brick.press(14)
        assert driver.take_button() is BodyButton.STOP
        driver.show(Mode.AUTONOMOUS)
        assert "autonomous" in brick.screen.read_text()
        assert brick.light("led1:red:brick-status") == 255


def test_options_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="--track-m must be more than 0"):
        ChassisOptions(track_m=0)
