"""A lost websocket is opened again, and nothing moves by that."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from robot.bodies.remote.driver import RemoteOptions
from robot.bodies.remote.ws import WebsocketLine, WsDriver
from robot.errors import DriveError
from robot.types import Action
from tests.contract.real_parts import check_driver_on_its_real_line
from tests.robot.bodies.sending import send_until
from tests.standins.ws_robot import WsRobot

from . import reconnecting_cases


def switched_off_and_on(robot: WsRobot) -> None:
    robot.start_again()


def silent_for_a_while(robot: WsRobot) -> None:
    """As when the robot's power is cut: nothing closes the connection."""
    robot.silent.set()


@pytest.mark.realtime
def test_a_real_line_that_is_lost_is_opened_again_and_moves_nothing_by_itself() -> None:
    check_driver_on_its_real_line("ws")
    for lose in (switched_off_and_on, silent_for_a_while):
        check_that_it_comes_back(lose)
    check_that_it_catches_up_with_late_answers()
    for check in reconnecting_cases.CASES:
        check()


def check_that_it_comes_back(lose: Callable[[WsRobot], None]) -> None:
    with (
        WsRobot("geheim") as robot,
        WsDriver(RemoteOptions(address=robot.address, secret="geheim")) as driver,
    ):
        send_until(driver, Action.FORWARD, lambda: robot.is_moving)
        lose(robot)
        moved_s = robot.ends_s
        for _ in range(1000):
            try:
                driver.sense()
                if robot.connections > 1:
                    break
            except DriveError as error:
                assert "has not answered" in str(error)
                robot.silent.clear()
            time.sleep(0.01)
        for _ in range(20):
            driver.sense()
        assert robot.connections == 2
        assert robot.ends_s == moved_s, "it asked, and gave no order"
        send_until(driver, Action.LEFT, lambda: robot.is_moving)


def check_that_it_catches_up_with_late_answers() -> None:
    """A reader that takes one answer for each order, and no more, stays behind forever."""
    with WsRobot("geheim") as robot:
        host, _, port = robot.address.partition(":")
        line = WebsocketLine(host, int(port))
        robot.repeats = 5
        line.send(b'{"move": "stop", "seq": 0}\t')
        answers = 0
        for _ in range(30_000):  # of a millisecond each
            answers += line.receive(0.001) is not None
            if answers == 6:
                break
        line.close()
        assert answers == 6
