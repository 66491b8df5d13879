"""A robot whose answers are late obeys; a robot that obeys no order does not."""

from __future__ import annotations

import json
from collections import deque

import pytest

from robot.bodies.remote.driver import RemoteOptions
from robot.bodies.remote.udp import UdpDriver
from robot.errors import DriveError
from robot.testing import VirtualClock
from robot.types import Action, Point


class LateLine:
    """Answers this number of orders late, one answer each; with `obeys` False it obeys none of
    them.

    `tells` are further fields of its reports; `orders` are the received orders.
    """

    def __init__(self, lag: int, *, obeys: bool = True, **tells: object) -> None:
        self.clock, self.tells = VirtualClock(), tells
        self.orders: list[dict[str, object]] = []
        self.obeys = obeys
        self._seq = 0
        self._is_due = False
        self._answers = deque(self._answer() for _ in range(lag))

    def _answer(self) -> bytes:
        told = {"nonce": "aa", "seq": self._seq, "ms": 1, "distance_m": 0.5, "bumped": False}
        return json.dumps({**told, "battery": 0.9, **self.tells}).encode()

    def send(self, message: bytes) -> None:
        order = json.loads(message.partition(b"\t")[0])
        self.orders.append(order)
        self._seq = order.get("seq", self._seq) if self.obeys else self._seq
        self._answers.append(self._answer())
        self._is_due = True

    def receive(self, timeout_s: float) -> bytes | None:
        self.clock.advance(0.01)
        is_due, self._is_due = self._is_due, False
        return self._answers.popleft() if is_due else None

    def close(self) -> None:
        pass


class StallingLine(LateLine):
    """The computer is paused while it waits for the first answers."""

    def __init__(self, stalls: int) -> None:
        super().__init__(0)
        self._stalls = stalls

    def receive(self, timeout_s: float) -> bytes | None:
        if self._stalls:
            self._stalls -= 1
            self.clock.advance(10.0)
            return None
        return super().receive(timeout_s)


def driver_on(line: LateLine) -> UdpDriver:
    driver = UdpDriver(RemoteOptions(address="robot"), line.clock)
    driver._open_line = lambda: line
    driver.connect()
    return driver


@pytest.mark.parametrize("lag", [0, 1, 2, 7])
def test_a_robot_that_answers_late_still_obeys(lag: int) -> None:
    driver = driver_on(LateLine(lag))
    for number in range(40):
        try:
            driver.send_action((Action.FORWARD, Action.LEFT)[number % 2])
        except DriveError:
            assert number < lag, "as soon as the first answer is there, it is heard"


@pytest.mark.parametrize("points", [True, False, None, 1, "yes"])
def test_only_robots_that_say_that_they_take_degrees_get_them(points: object) -> None:
    line = LateLine(0, points=points)
    driver = driver_on(line)
    assert driver.takes_points is (points is True)
    assert driver.send_point(Point(-0.6, 0.4), speed_scale=0.5) is Action.LEFT
    told = {name: line.orders[-1].get(name) for name in ("move", "speed", "steering", "throttle")}
    numbers = {"steering": -0.6, "throttle": 0.4} if points is True else {}
    assert told == {"move": "left", "speed": 0.5, "steering": None, "throttle": None} | numbers
    assert set(line.orders[-1]) == {"move", "for_ms", "speed", "seq", "seen_ms", *numbers}
    driver.send_point(Point(0.0, 0.0))
    assert line.orders[-1]["move"] == "stop" and "steering" not in line.orders[-1]


@pytest.mark.parametrize("lag", [0, 1, 2])
def test_a_robot_that_obeys_no_order_is_reported_soon(lag: int) -> None:
    driver = driver_on(LateLine(lag, obeys=False))
    with pytest.raises(DriveError, match="answers, but does not obey orders"):
        for _ in range(5):
            driver.send_action(Action.FORWARD)


@pytest.mark.parametrize("stalls", [0, 1, 5])
def test_a_computer_that_paused_asks_again_before_it_gives_up(stalls: int) -> None:
    assert driver_on(StallingLine(stalls)).is_connected


def test_a_robot_that_never_answers_is_given_up() -> None:
    with pytest.raises(DriveError, match="does not answer"):
        driver_on(StallingLine(1000))
