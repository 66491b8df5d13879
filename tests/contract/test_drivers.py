"""What every driver must do, whatever it drives."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot.driver import ACTION_TIMEOUT_S
from robot.errors import NotConnectedError
from robot.moves import CLASSIC
from robot.rig.options import options_of
from robot.rig.plugins import camera_names, driver_names, load_driver
from robot.types import Action, Sensors
from tests.contract.builders import DRIVERS, DriverCase


@pytest.fixture(params=driver_names())
def case(request: pytest.FixtureRequest) -> Iterator[DriverCase]:
    assert request.param in DRIVERS, f"say in builders.py how to build {request.param!r}"
    with DRIVERS[request.param]() as built:
        yield built
        built.driver.disconnect()


def test_it_declares_what_it_is(case: DriverCase) -> None:
    kind = type(case.driver)
    assert load_driver(kind.name) is kind
    assert kind.default_camera in camera_names()
    assert all(option.help for option in options_of(kind.options_type))
    assert Action.STOP not in case.driver.moves


def test_stop_and_disconnect_are_safe_before_connect_and_twice(case: DriverCase) -> None:
    for _ in range(2):
        case.driver.stop()
        case.driver.disconnect()
    assert not case.driver.is_connected


def test_connect_twice_is_one_connection(case: DriverCase) -> None:
    case.driver.connect()
    case.driver.connect()
    assert case.driver.is_connected
    case.driver.disconnect()
    assert not case.driver.is_connected


def test_it_refuses_to_move_before_connect(case: DriverCase) -> None:
    with pytest.raises(NotConnectedError):
        case.driver.send_action(Action.FORWARD)


def test_every_move_moves_and_stop_stops(case: DriverCase) -> None:
    with case.driver as driver:
        for move in driver.moves:
            assert driver.send_action(move) is move
            assert case.is_moving(), move
            assert driver.send_action(Action.STOP) is Action.STOP
            assert not case.is_moving(), move
            driver.send_action(move)
            driver.stop()
            assert not case.is_moving(), move


def is_moving_half_way(case: DriverCase, action: Action) -> bool:
    """Send an action, and look before its time is over.

    Where time is real, a busy machine may look too late: then once more.
    """
    for _ in range(5):
        case.driver.send_action(action)
        case.forward(ACTION_TIMEOUT_S / 2)
        if case.is_moving():
            return True
    return False


def test_an_action_ends_by_itself(case: DriverCase) -> None:
    with case.driver:
        assert is_moving_half_way(case, Action.FORWARD)
        case.forward(ACTION_TIMEOUT_S)
        assert not case.is_moving()


def test_an_action_that_is_renewed_goes_on(case: DriverCase) -> None:
    with case.driver as driver:
        for _ in range(5):
            driver.send_action(Action.LEFT)
            case.forward(ACTION_TIMEOUT_S / 2)
        assert is_moving_half_way(case, Action.LEFT)


def test_bad_actions_are_refused(case: DriverCase) -> None:
    with case.driver as driver:
        for scale in (0.0, -1.0, 1.01, float("nan")):
            with pytest.raises(ValueError, match="speed_scale"):
                driver.send_action(Action.FORWARD, speed_scale=scale)
        for action in (*CLASSIC, Action("no_such_move")):
            if action not in driver.moves:
                with pytest.raises(ValueError, match=action.value):
                    driver.send_action(action)
        assert not case.is_moving()


def test_it_senses(case: DriverCase) -> None:
    with case.driver as driver:
        sensors = driver.sense()
    assert isinstance(sensors, Sensors)
    assert sensors.distance_m is None or 0.0 <= sensors.distance_m <= 3.0
    assert sensors.battery_share is None or 0.0 <= sensors.battery_share <= 1.0


def test_leaving_the_context_stops_the_body(case: DriverCase) -> None:
    with case.driver as driver:
        driver.send_action(Action.FORWARD)
    assert not case.is_moving()
