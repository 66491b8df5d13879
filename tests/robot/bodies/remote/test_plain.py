"""Orders and reports as words of one line."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.remote.orders import BodyReport, Order
from robot.bodies.remote.plain import (
    encode_plain_order,
    encode_plain_report,
    parse_plain_order,
    parse_plain_report,
)
from robot.driver import CLASSIC
from robot.types import Action, Point, Sensors

SHARES = st.integers(-10_000, 10_000).map(lambda share: share / 10_000)
WORDS = st.text("0123456789- .einfaforwd\u0661\u00b2", max_size=40).map(str.encode)


@given(st.binary(max_size=60) | WORDS)
def test_whatever_comes_is_read_or_left(data: bytes) -> None:
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
