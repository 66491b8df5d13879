"""Orders and reports as bytes: the one-page protocol, and words of one line."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
from robot.errors import ConfigurationError
from robot.moves import CLASSIC
from robot.types import Action, Point, Sensors

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


@given(st.binary(max_size=300))
def test_random_bytes_are_not_a_report(data: bytes) -> None:
    assert parse_report(data) is None


@pytest.mark.parametrize("number", [b"1" * 400, b"-" + b"1" * 400, b"1e999", b"NaN", b"-0.1"])
def test_an_impossible_sensor_value_is_ignored(number: bytes) -> None:
    report = parse_report(b'{"nonce": "aa", "seq": 3, "ms": 99, "battery": %s}' % number)
    assert report is not None
    assert report.sensors == Sensors()


@pytest.mark.parametrize("word", ["inf", "-inf", "nan", "-nan", "NaN", "Infinity", "INF", "ovf"])
def test_a_report_may_contain_infinity(word: str) -> None:
    """Like MicroPython's `json.dumps(float("inf"))`; such a report was dropped, and the robot
    counted as silent."""
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
