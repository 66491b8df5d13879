"""The brick's body and its driver, on an EV3 made of files."""

from __future__ import annotations

import math

import pytest

from robot.bodies.ev3.agent import console, sensors
from robot.bodies.ev3.driver import ChassisOptions, Ev3Driver, Ev3Options, wheels_of
from robot.bodies.ev3.fake_brick import DEFAULTS, LEFTOVERS, FakeBrick
from robot.devkit.wheels import CLASSIC_POINTS
from robot.driver import BodyButton
from robot.errors import ConfigurationError, DriveError
from robot.types import Action, Mode
from tests.robot.bodies.ev3.virtual_agent import close_motor


def make_driver(brick: FakeBrick, **options: object) -> Ev3Driver:
    found = Ev3Options(brick_root=str(brick.root), **options)
    return Ev3Driver(found, brick.clock)


@pytest.mark.parametrize("turn_by", ["backward", "forward", "both"])
def test_speeds_are_those_of_the_paper_whichever_wheel_turns(turn_by: str) -> None:
    options = ChassisOptions(turn_by=turn_by)
    wheels = wheels_of(options)
    assert wheels.at(CLASSIC_POINTS[Action.FORWARD]) == pytest.approx((360, 360), rel=0.01)
    left, right = wheels.at(CLASSIC_POINTS[Action.LEFT])
    rim_m_per_deg = math.pi * options.wheel_diameter_m / 360
    assert (right - left) * rim_m_per_deg / options.track_m == pytest.approx(math.radians(18.5))
    assert wheels.at(CLASSIC_POINTS[Action.RIGHT]) == (right, left)


def test_each_move_is_timed_by_the_motors_and_scaled(brick: FakeBrick) -> None:
    with make_driver(brick) as driver:
        driver.send_action(Action.FORWARD)
        brick.wait_until(lambda: set(brick.speeds().values()) == {360})
        driver.send_action(Action.LEFT, speed_scale=0.5)
        brick.wait_until(lambda: brick.speeds() == {"outB": -45, "outC": 0})
    moves = [c for c in brick.commands if c.command.startswith("run")]
    assert {(c.command, c.time_ms) for c in moves} == {("run-timed", 400)}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"left_port": "outA"}, r"port outA; .*--left-port .*lego-ev3-l-motor at ev3-ports:outB"),
        ({"left_port": "out"}, "port out;"),
        ({"ultrasonic_port": "in2"}, r"port in2; .*--ultrasonic-port .*found: lego-nxt-us at"),
        ({"ultrasonic_port": "in1:i2c"}, "ultrasonic sensor at port in1:i2c"),
        ({"touch_port": "in3"}, r"port in3.*--touch-port"),
    ],
)
def test_a_wrong_port_is_reported_in_one_line(
    brick: FakeBrick, options: dict[str, str], words: str
) -> None:
    brick.add_sensor("in1:i2c1", "lego-nxt-us", 42)
    with pytest.raises(DriveError, match=words) as failure:
        make_driver(brick, **options).connect()
    assert "\n" not in str(failure.value)
    for port in ("in1", "in1:i2c1", "ev3-ports:in1", " in1"):
        with make_driver(brick, ultrasonic_port=port) as driver:
            assert driver.sense().distance_m == pytest.approx(0.42)


def test_two_motors_at_one_port_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="--left-port and --right-port are both outA"):
        ChassisOptions(left_port="outA", right_port="outA")


def test_a_motor_that_was_unplugged_is_found_again(brick: FakeBrick) -> None:
    with make_driver(brick) as driver:
        driver.send_action(Action.FORWARD)
        brick.wait_until(brick.is_moving)
        close_motor(driver, 1)
        brick.unplug_motor("outC")
        with pytest.raises(DriveError, match="outB and outC do not answer"):
            driver.send_action(Action.FORWARD)
        brick.catch_up()
        assert not brick.is_moving(), "the other motor stops, too"
        with pytest.raises(DriveError, match="no right motor at port outC"):
            driver.send_action(Action.FORWARD)
        brick.add_motor("outC")
        driver.send_action(Action.FORWARD)
        brick.wait_until(lambda: set(brick.speeds().values()) == {360})


def test_buttons_are_read_and_lights_and_screen_are_set(brick: FakeBrick) -> None:
    driver = make_driver(brick)
    driver.announce("http://192.168.1.7:8000")
    with driver:
        assert "192.168.1.7" in brick.screen.read_text()
        assert brick.light("led0:red:brick-status") == 0
        assert brick.light("led1:green:brick-status") == 255
        assert driver.take_button() is None
        brick.press(28)
        assert driver.take_button() is BodyButton.START
        brick.press(28)
        brick.press(14)
        assert driver.take_button() is BodyButton.STOP
        driver.show(Mode.AUTONOMOUS)
        assert "autonomous" in brick.screen.read_text()
        assert brick.light("led1:red:brick-status") == 255


def test_another_programs_leftovers_are_undone_before_anything_moves(brick: FakeBrick) -> None:
    with make_driver(brick) as driver:
        brick.catch_up()
        for port in ("outB", "outC"):
            motor = brick.motors[port]
            first = next(c.command for c in brick.commands if c.port == port)
            assert first == "reset"
            found = {name: motor.read(name) for name in LEFTOVERS}
            assert found == {**DEFAULTS, "stop_action": "brake"}
        assert driver.rolled_m() == (0.0, 0.0)
        driver.send_action(Action.FORWARD)
        brick.wait_until(lambda: set(brick.speeds().values()) == {360}, 1)


def test_a_motor_that_cannot_be_reset_is_reported_in_one_line(brick: FakeBrick) -> None:
    brick.motors["outC"].kept.add("polarity")
    with pytest.raises(
        DriveError, match="outC cannot be reset: another program changes its settings; end that"
    ):
        make_driver(brick).connect()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"forward_speed_mps": 0.5}, r"--forward-speed-mps 0.5 .* outB, .* only 1050; choose"),
        ({"turn_rate_deg_s": 300, "turn_by": "forward"}, r"--turn-rate-deg-s .* outC, .* choose"),
    ],
)
def test_a_speed_above_the_motors_limit_names_the_limit(
    brick: FakeBrick, options: dict[str, object], words: str
) -> None:
    driver = make_driver(brick, **options)
    with pytest.raises(ConfigurationError, match=words) as failure:
        driver.connect()
    assert not driver.is_connected
    most = float(str(failure.value).split("choose ")[1].split()[0])
    option = str(failure.value).split()[0].removeprefix("--").replace("-", "_")
    with make_driver(brick, **{**options, option: most}) as slower:
        for move in slower.moves:
            slower.send_action(move)
            brick.catch_up()
    assert brick.refused == []


def test_the_agent_itself_refuses_what_the_kernel_would(brick: FakeBrick) -> None:
    with make_driver(brick) as driver:
        assert driver._connection is not None
        driver.send_action(Action.FORWARD)
        brick.wait_until(brick.is_moving)
        with pytest.raises(DriveError, match=r"outB turns at most 1050 counts .* not 1051"):
            driver._connection.run(1051, 0, 400)
        brick.wait_until(lambda: not brick.is_moving(), 1)
        assert brick.refused == []


def test_sensors_are_read_in_their_order_and_ports(brick: FakeBrick) -> None:
    brick.add_sensor("in3", "lego-ev3-us", 1234, decimals=1)
    for port in ("in4", "in1"):
        brick.add_sensor(port, "lego-ev3-touch", 0)
    with make_driver(brick) as driver:
        sensors = driver.sense()
        assert sensors.distance_m == pytest.approx(1.234)
        assert sensors.battery_share == pytest.approx(0.5)
        assert (sensors.bumped, sensors.bumpers) == (False, (False, False))
        brick.set_sensor("in4", 1)
        assert (driver.sense().bumped, driver.sense().bumpers) == (True, (False, True))
    for ports, bumped, bumpers in (
        ("in4,in1", True, (True, False)),
        ("in1", False, (False,)),
        ("none", None, ()),
    ):
        with make_driver(brick, touch_port=ports) as driver:
            assert (driver.sense().bumped, driver.sense().bumpers) == (bumped, bumpers), ports


def test_sensors_that_appear_late_are_found(
    brick: FakeBrick, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sensors, "SEARCH_S", 0.0)
    with make_driver(brick) as driver:
        assert (driver.sense().distance_m, driver.sense().bumpers) == (None, ())
        brick.add_sensor("in4", "lego-ev3-us", 500, decimals=1)
        brick.add_sensor("in1", "lego-ev3-touch", 1)
        assert driver.sense().distance_m == pytest.approx(0.5)
        assert driver.sense().bumpers == (True,)
        brick.add_sensor("in2", "lego-nxt-touch", 0)
        assert driver.sense().bumpers == (True, False)


@pytest.mark.parametrize("missing", ["", "mode", "decimals", "value0"])
def test_a_sensor_that_is_unplugged_or_makes_no_contact_yet_is_reported_until_it_is_there(
    brick: FakeBrick, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    monkeypatch.setattr(sensors, "SEARCH_S", 0.0)
    with make_driver(brick) as driver:
        brick.add_sensor("in4", "lego-ev3-us", 500, decimals=1)
        file = brick.root / "sys/class/lego-sensor/sensor0" / missing
        if not missing:  # the files of a sensor that was read stay open here
            driver.sense()
            driver._connection.sensors._ultrasonic._ports[0].close()
        there = file.rename(brick.root / "away")
        for _ in range(2):
            with pytest.raises(
                DriveError, match=r"ultrasonic sensor does not answer.*check its cable"
            ):
                driver.sense()
        there.rename(file)
        assert driver.sense().distance_m == pytest.approx(0.5)


def test_the_buttons_are_grabbed_and_given_back(
    brick: FakeBrick, monkeypatch: pytest.MonkeyPatch
) -> None:
    grabs = []

    def ioctl(_file: object, request: int, argument: int) -> int:
        if request == console.EVIOCGRAB:
            grabs.append(argument)
            return 0
        raise OSError("no such request here")

    monkeypatch.setattr(console.fcntl, "ioctl", ioctl)
    with make_driver(brick) as driver:
        assert grabs[-1] == 1, "the driver has taken the keys from the brick's menu"
        brick.press(console.KEY_BACK, for_s=1.0)
        assert driver.take_button() is BodyButton.STOP
        assert grabs[-1] == 1
        brick.press(console.KEY_BACK, for_s=console.MENU_S)
        assert driver.take_button() is BodyButton.STOP
        assert grabs[-1] == 0, "a long press of Back gives the keys to the brick's menu"
        brick.press(console.KEY_ENTER)
        assert driver.take_button() is None, "in the menu, this key may switch the brick off"
        driver.show(Mode.TRAIN)
        assert grabs[-1] == 1, "the next start takes the keys again"
        brick.press(console.KEY_ENTER)
        assert driver.take_button() is BodyButton.START
