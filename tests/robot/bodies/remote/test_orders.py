"""Orders and reports in JSON and as words of one line, and robots that are late or do not obey."""

from __future__ import annotations

import json
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.remote.driver import RemoteOptions
from robot.bodies.remote.orders import (
    BodyReport,
    Order,
    encode_order,
    parse_moves,
    parse_report,
    split_address,
)
from robot.bodies.remote.plain import (
    encode_plain_order,
    encode_plain_report,
    parse_plain_order,
    parse_plain_report,
)
from robot.bodies.remote.udp import UdpDriver
from robot.driver import Sensors
from robot.errors import ConfigurationError, DriveError
from robot.moves import CLASSIC
from robot.testing import VirtualClock
from robot.types import Action, Point

ANYTHING = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=9), inner),
)


@given(st.dictionaries(st.sampled_from(["nonce", "seq", "ms", "distance_m", "bumped"]), ANYTHING))
def test_reports_are_read_or_ignored(plain: dict[str, object]) -> None:
    report = parse_report(json.dumps(plain).encode())
    if report is not None:
        assert (report.nonce, report.seq, report.ms) == (plain["nonce"], plain["seq"], plain["ms"])
        distance_m = report.sensors.distance_m
        assert distance_m is None or 0 <= distance_m <= 10


@pytest.mark.parametrize("number", [b"1" * 400, b"1e999", b"NaN", b"-0.1"])
def test_an_impossible_sensor_value_is_ignored(number: bytes) -> None:
    report = parse_report(b'{"nonce": "aa", "seq": 3, "ms": 99, "battery": %s}' % number)
    assert report is not None
    assert report.sensors == Sensors()


@pytest.mark.parametrize("word", ["inf", "-nan", "Infinity", "ovf"])
def test_a_report_may_contain_infinity(word: str) -> None:
    """MicroPython's `json.dumps` writes infinity as `inf`. A report with `inf` was once dropped,
    and the robot counted as silent."""
    text = (
        f'{{"nonce": "inf nan \\" inf", "distance_m": {word}, "seq": 3, "ms": 9, "battery":{word}}}'
    )
    report = parse_report(text.encode())
    assert report is not None
    assert (report.nonce, report.seq, report.sensors) == ('inf nan " inf', 3, Sensors())
    assert parse_report(b'{"nonce": "a", "seq": %s, "ms": 9}' % word.encode()) is None


def test_an_order_holds_for_one_robot_one_start_and_one_secret() -> None:
    report = parse_report(b'{"nonce": "aa", "seq": 3, "ms": 99, "distance_m": 1, "battery": 0.5}')
    other = parse_report(b'{"nonce": "ab", "seq": 3, "ms": 99}')
    assert report is not None and other is not None
    assert report.sensors == Sensors(distance_m=1.0, battery_share=0.5)
    orders = [
        encode_order(Order(Action.LEFT, 400, 0.5, 4, r.ms), r.nonce, secret)
        for r in (report, other)
        for secret in ("one", "two")
    ]
    assert len({order.partition(b"\t")[2] for order in orders}) == 4
    text, _, mac = orders[0].partition(b"\t")
    assert json.loads(text) == {
        "move": "left",
        "for_ms": 400,
        "speed": 0.5,
        "seq": 4,
        "seen_ms": 99,
    }
    assert len(mac) == 16 and len(orders[0]) < 200


def test_moves_are_parsed_from_the_option() -> None:
    moves = parse_moves("forward, half_left:-0.5:0.3,push")
    assert moves[0] is CLASSIC[Action.FORWARD]
    assert moves[1].point == (-0.5, 0.3) and moves[1].labels == {"en": "half left"}
    assert moves[2].name == "push" and moves[2].point is None


@pytest.mark.parametrize(
    "text", ["", "Fast", "stop", "a:1", "a:1:2", "a:x:y", "left,left", "a:0:nan"]
)
def test_invalid_moves_are_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match="--body-moves"):
        parse_moves(text)


def test_addresses_are_parsed_and_others_are_refused() -> None:
    assert split_address("robot.local", 4210) == ("robot.local", 4210)
    assert split_address("10.0.0.7:99", 4210) == ("10.0.0.7", 99)
    for wrong in ("", ":4210", "http://a/b", "a:b", "a:0", "a:99999"):
        with pytest.raises(ConfigurationError, match="--address"):
            split_address(wrong, 4210)


# As words of one line -------------------------------------------------------------------------

SHARES = st.integers(-10_000, 10_000).map(lambda share: share / 10_000)
WORDS = st.text("0123456789- .einfaforwd\u0661\u00b2", max_size=40).map(str.encode)


@given(st.binary(max_size=60) | WORDS)
def test_any_bytes_are_read_or_ignored(data: bytes) -> None:
    assert parse_report(data) is None
    report = parse_plain_report(data)
    if report is not None:
        assert report.sensors.distance_m is None or 0 <= report.sensors.distance_m <= 10
        assert report.sensors.battery_share is None or 0 <= report.sensors.battery_share <= 1
    order = parse_plain_order(data, CLASSIC)
    if order is not None:
        assert order.for_ms > 0 and 0 < order.speed <= 1 and order.seq > 0
        assert all(-1 <= number <= 1 for number in order.point or ())


@given(
    st.sampled_from([Action.STOP, *CLASSIC]),
    st.integers(1, 10**6),
    st.floats(0.001, 1),
    st.integers(1, 2**40),
    st.integers(0, 2**40),
    st.none() | st.builds(Point, SHARES, SHARES),
)
def test_an_order_is_read_as_it_was_written(
    move: Action, for_ms: int, speed: float, seq: int, ms: int, point: Point | None
) -> None:
    text = encode_plain_order(Order(move, for_ms, speed, seq, ms, point))
    order = parse_plain_order(text, CLASSIC)
    assert order is not None and abs(order.speed - speed) <= 0.0005
    assert (order.move, order.for_ms, order.seq, order.seen_ms) == (move, for_ms, seq, ms)
    assert order.point == point
    assert parse_plain_order(text, ()) is None or move is Action.STOP


@given(
    st.integers(0, 2**40),
    st.none() | st.integers(0, 10_000).map(lambda mm: mm / 1000),
    st.none() | st.booleans(),
    st.none() | st.integers(0, 100).map(lambda percent: percent / 100),
    st.booleans(),
)
def test_a_report_is_read_as_it_was_written(
    number: int,
    distance_m: float | None,
    bumped: bool | None,
    battery: float | None,
    points: bool,
) -> None:
    sensors = Sensors(distance_m=distance_m, bumped=bumped, battery_share=battery)
    report = BodyReport(nonce="", seq=number, ms=number, sensors=sensors, takes_points=points)
    assert parse_plain_report(encode_plain_report(report)) == report


# Obeyed orders ---------------------------------------------------------------------------------


class LateLine:
    """A robot that answers this number of orders late, each with one answer. If `obeys` is False,
    it obeys none of them. The computer is paused while it waits for the first `stalls` answers.

    `tells` are further fields of the robot's reports; `orders` are the orders that it has received.
    """

    def __init__(self, lag: int, *, obeys: bool = True, stalls: int = 0, **tells: object) -> None:
        self.clock, self.tells, self.stalls = VirtualClock(), tells, stalls
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
        if self.stalls:
            self.stalls -= 1
            self.clock.advance(10.0)
            return None
        self.clock.advance(0.01)
        is_due, self._is_due = self._is_due, False
        return self._answers.popleft() if is_due else None

    def close(self) -> None:
        pass


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
            assert number < lag, "the driver accepts orders as soon as the first answer has arrived"


@pytest.mark.parametrize("points", [True, False, "yes"])
def test_only_robots_that_report_proportional_steering_get_points(points: object) -> None:
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


def test_a_computer_that_paused_asks_again_before_it_gives_up() -> None:
    assert all(driver_on(LateLine(0, stalls=stalls)).is_connected for stalls in (0, 1, 5))
    with pytest.raises(DriveError, match="does not answer"):
        driver_on(LateLine(0, stalls=1000))
