"""The one-page protocol as bytes."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.remote.orders import Order, encode_order, parse_moves, parse_report, split_address
from robot.driver import CLASSIC
from robot.errors import ConfigurationError
from robot.types import Action, Sensors

ANYTHING = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=9), inner),
)


@given(st.dictionaries(st.sampled_from(["nonce", "seq", "ms", "distance_m", "bumped"]), ANYTHING))
def test_reports_are_read_or_left(plain: dict[str, object]) -> None:
    report = parse_report(json.dumps(plain).encode())
    if report is not None:
        assert (report.nonce, report.seq, report.ms) == (plain["nonce"], plain["seq"], plain["ms"])
        distance_m = report.sensors.distance_m
        assert distance_m is None or 0 <= distance_m <= 10


@given(st.binary(max_size=300))
def test_rubbish_is_no_report(data: bytes) -> None:
    assert parse_report(data) is None


@pytest.mark.parametrize("number", [b"1" * 400, b"-" + b"1" * 400, b"1e999", b"NaN", b"-0.1"])
def test_a_sensor_that_says_what_cannot_be_says_nothing(number: bytes) -> None:
    report = parse_report(b'{"nonce": "aa", "seq": 3, "ms": 99, "battery": %s}' % number)
    assert report is not None
    assert report.sensors == Sensors()


@pytest.mark.parametrize("word", ["inf", "-inf", "nan", "-nan", "NaN", "Infinity", "INF", "ovf"])
def test_a_small_computer_writes_that_it_sees_nothing(word: str) -> None:
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


def test_moves_are_what_a_person_says() -> None:
    moves = parse_moves("forward, half_left:-0.5:0.3,push")
    assert moves[0] is CLASSIC[Action.FORWARD]
    assert moves[1].point == (-0.5, 0.3) and moves[1].labels == {"en": "half left"}
    assert moves[2].name == "push" and moves[2].point is None


@pytest.mark.parametrize(
    "text", ["", "Fast", "stop", "a:1", "a:1:2", "a:x:y", "left,left", "a:0:nan"]
)
def test_moves_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match="--body-moves"):
        parse_moves(text)


def test_addresses() -> None:
    assert split_address("robot.local", 4210) == ("robot.local", 4210)
    assert split_address("10.0.0.7:99", 4210) == ("10.0.0.7", 99)
    for wrong in ("", ":4210", "http://a/b", "a:b", "a:0", "a:99999"):
        with pytest.raises(ConfigurationError, match="--address"):
            split_address(wrong, 4210)
