"""Orders and reports as words of one line, for bodies with a private connection. Pure.

An order is `MOVE FOR_MS SPEED NUMBER SEEN_MS`, for example `forward 400 1.0 7 81234`: the move, its
duration in ms, its share of full speed, the order's number, and the time of the body's newest
report by the body's clock. A report is `NUMBER MS DISTANCE BUMPER BATTERY`, for example `7 81240
420 0 80`: the number of the last obeyed order, the body's time in ms, the distance in mm, whether
the bumper is pressed (0 or 1), and the battery in percent. `-` stands for a sensor that is missing.
`?` requests a report. A body that can steer proportionally adds the word `points` to its reports.
Orders to such a body may end in `STEERING THROTTLE`.
"""

from __future__ import annotations

import math
from collections.abc import Container

from robot.bodies.remote.orders import BodyReport, Order
from robot.driver import Sensors
from robot.types import Action, Point

HELLO = b"?"
LATE_MS = 500
"""Maximum time from an order's `SEEN_MS` to the end of its move, in milliseconds. If this time has
already passed when an order arrives, the body stops."""
LONGEST_MS = 500


def encode_plain_order(order: Order) -> bytes:
    """Encode one order, without the end of the line."""
    words = [order.move, order.for_ms, round(order.speed, 3), order.seq, order.seen_ms]
    words += [f"{number:.4f}" for number in order.point or ()]
    return " ".join(map(str, words)).encode()


def parse_plain_order(data: bytes, moves: Container[Action]) -> Order | None:
    """Parse one order; return None if it is invalid, or names a move that this body lacks."""
    try:
        name, for_ms, speed, seq, seen_ms, *numbers = data.decode("ascii").split()
        point = Point(*map(float, numbers)) if numbers else None
        order = Order(Action(name), int(for_ms), float(speed), int(seq), int(seen_ms), point)
    except (ValueError, TypeError):
        return None
    is_known = order.move is Action.STOP or order.move in moves
    is_sound = 0 < order.speed <= 1 and order.for_ms > 0 and order.seq > 0
    is_sound = is_sound and all(-1 <= number <= 1 for number in point or ())
    return order if is_known and is_sound else None


def encode_plain_report(report: BodyReport) -> bytes:
    """Encode one report, without the end of the line."""
    sensors = report.sensors
    distance = "-" if sensors.distance_m is None else round(1000 * sensors.distance_m)
    bumped = "-" if sensors.bumped is None else int(sensors.bumped)
    battery = "-" if sensors.battery_share is None else round(100 * sensors.battery_share)
    points = " points" if report.takes_points else ""
    return f"{report.seq} {report.ms} {distance} {bumped} {battery}{points}".encode()


def parse_plain_report(data: bytes) -> BodyReport | None:
    words = data.split()
    takes_points = words[5:] == [b"points"]
    if len(words) != 5 + takes_points or not (words[0].isdigit() and words[1].isdigit()):
        return None
    distance_mm, bumped, battery = (_number(word) for word in words[2:5])
    return BodyReport(
        seq=int(words[0]),
        ms=int(words[1]),
        sensors=Sensors(
            distance_m=None if distance_mm is None else min(distance_mm / 1000, 10.0),
            bumped=None if bumped is None else bumped > 0,
            battery_share=None if battery is None else min(battery / 100, 1.0),
        ),
        takes_points=takes_points,
    )


def _number(word: bytes) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) and value >= 0 else None
