"""Drives LEGO's double motor by LEGO's own library, over a simulated transport."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

from robot.bodies.lego_education.driver import LegoEducationDriver, LegoEducationOptions
from robot.driver import BodyButton
from robot.errors import DriveError, MissingExtraError
from robot.types import Action
from tests.contract.real_parts import check_real_driver
from tests.kit.wait import wait_until
from tests.standins.lego_education import FakeDoubleMotor


@pytest.fixture
def motor() -> Iterator[FakeDoubleMotor]:
    with FakeDoubleMotor() as running:
        yield running


def driver_for(motor: FakeDoubleMotor, hub: str = "") -> LegoEducationDriver:
    return LegoEducationDriver(LegoEducationOptions(hub=hub), library=motor.library)


@pytest.mark.realtime
def test_a_motor_is_driven_stopped_by_its_button_and_lost(motor: FakeDoubleMotor) -> None:
    check_real_driver(driver_for(motor), lambda: motor.is_moving)
    motor.told.clear()
    moves_are_timed_by_the_motor_and_scaled(motor)
    its_button_stops_once(motor)
    a_motor_that_was_out_of_reach_is_driven_again(motor)


def moves_are_timed_by_the_motor_and_scaled(motor: FakeDoubleMotor) -> None:
    with driver_for(motor) as driver:
        state = (motor.end_state, motor.acceleration, motor.steering)
        assert state == (motor.library.MOTOR_END_STATE_BRAKE, (100, 100), 50)
        for move in driver.moves:
            driver.send_action(move, speed_scale=0.5)
        assert driver.sense().battery_share == 0.8
        wait_until(lambda: len(motor.told) == 4)
    library = motor.library
    assert motor.told == [
        (library.MOVEMENT_DIRECTION_FORWARD, 25, 400),
        (library.MOVEMENT_DIRECTION_LEFT, 12, 400),
        (library.MOVEMENT_DIRECTION_RIGHT, 12, 400),
        (library.MOVEMENT_DIRECTION_BACKWARD, 25, 400),
    ]


def its_button_stops_once(motor: FakeDoubleMotor) -> None:
    with driver_for(motor) as driver:
        assert driver.take_button() is None
        motor.is_pressed = True
        wait_until(lambda: driver.take_button() is BodyButton.STOP)
        assert driver.take_button() is None


def a_motor_that_was_out_of_reach_is_driven_again(motor: FakeDoubleMotor) -> None:
    with driver_for(motor) as driver:
        driver.send_action(Action.FORWARD)
        motor.cut()
        motor.hang_up()
        motor.others.append(twin := FakeDoubleMotor("A4:34:F1:00:00:02"))
        with pytest.raises(DriveError, match="the double motor has sent nothing"):
            driver.send_action(Action.FORWARD)
        motor.is_in_reach = True
        motor.end_state = 3  # another program has used the motor in between

        def drives() -> bool:
            try:
                driver.sense()
                driver.send_action(Action.FORWARD)
                return True
            except DriveError:
                return False

        wait_until(drives)
        assert motor.end_state == motor.library.MOTOR_END_STATE_BRAKE
        motor.cut()
        driver.disconnect()
        with pytest.raises(DriveError, match=r"was lost, and is not in range \(another"):
            driver.connect()
        assert not twin.told


def test_of_two_motors_the_one_that_is_named_is_driven(motor: FakeDoubleMotor) -> None:
    with pytest.raises(DriveError, match="'Otto' in its name is in range"):
        driver_for(motor, "Otto").connect()
    motor.others.append(FakeDoubleMotor("A4:34:F1:00:00:02"))
    with pytest.raises(DriveError, match=r"2 double motors .*--hub A4:34:F1:00:00:01"):
        driver_for(motor).connect()
    with driver_for(motor, "a4:34:f1:00:00:01") as driver:
        assert driver.device == "'Double Motor' (A4:34:F1:00:00:01)"


def test_each_error_inside_the_library_is_one_sentence(
    motor: FakeDoubleMotor, caplog: pytest.LogCaptureFixture
) -> None:
    motor.rpc_version = (9, 9, 9)
    with pytest.raises(DriveError, match="pip install --upgrade legoeducation"):
        driver_for(motor).connect()
    for error, says in (
        (OSError("[org.freedesktop.DBus.Error.ServiceUnknown] org.bluez"), "is off or missing"),
        (RuntimeError("Bluetooth device is turned off"), "Bluetooth is off; switch it on"),
    ):
        motor.search_fails = error
        with pytest.raises(DriveError, match=f"cannot search for double motors: .*{says}"):
            driver_for(motor).connect()
    assert not [record for record in caplog.records if record.exc_info]


def test_without_the_library_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "legoeducation", None)
    with pytest.raises(MissingExtraError, match=r"drivelesson\[lego-education\]"):
        LegoEducationDriver(LegoEducationOptions()).connect()
