"""Converts the steering of cars and two-wheeled robots, in other programs' formats, to moves."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Sequence

from robot.errors import RecordingError
from robot.exchange.reading import FULL, Reading
from robot.moves import Move, describe, move_at, point_of
from robot.recordings.editing import EpisodeFrame
from robot.types import DEFAULT_MOVES, Action, Point

ANGLES = ("angle", "steering", "user/angle", "steering_angle")
THROTTLES = ("throttle", "user/throttle")
"""Other programs' names of the throttle."""
FULL_MPS, FULL_TURN_RAD_S = 0.4, math.radians(45.0)
"""Speed at full throttle, and speed of turning at full lock: the defaults of this project's ROS
robot. Higher speeds count as full speed."""
FULL_TURN_DEG_S = math.degrees(FULL_TURN_RAD_S)
_TURNING = (*DEFAULT_MOVES, Action.SPIN_LEFT, Action.SPIN_RIGHT)
_UNIT_SHARE, _LEAST_BEYOND = 10, 2
"""The steering is assumed to be in another unit, such as degrees, if at least one in `_UNIT_SHARE`
values is beyond 1, and at least `_LEAST_BEYOND` values, because a single value may be damaged."""
_STANDING = 0.02
"""Mean speed of two wheels, as a share of full speed, below which a turning robot counts as
spinning."""
_STEERED = "the angle", "the throttle"
LabelAndPoint = tuple[Action | None, Point | None]
"""The label of a picture, and the steering and throttle of the label if known."""
LabelAndPoints = tuple[Action | None, Point | None, Point | None]
"""A picture's label; the pilot's steering and throttle, if the pilot steered proportionally; and
the label's steering and throttle, if known. A missing value is None."""


def read_meant(
    written: Sequence[object],
    reading: Reading | None = None,
    names: Sequence[str] = _STEERED,
    moves: Iterable[Action] = DEFAULT_MOVES,
) -> LabelAndPoint:
    """Return the driver's move, one of `moves`; None if no move drives in this direction.

    A car has only FORWARD, LEFT and RIGHT, so standing or backing up is not an example.

    `written` contains the values that a recording program wrote: the steering angle (-1 is full
    lock to the left), and the throttle if it is known. `names` contains their names, for error
    messages. If there is only the angle, the returned point is None. An angle beyond the threshold
    is a turn. Raises ValueError if a value is not a number in its range.
    """
    reading = reading or Reading()
    is_whole = len(written) == 2
    if len(written) != len(names) and is_whole:
        raise ValueError(f"{names[0]} is given without {names[1]}")
    angle = read_steering(written[0], names[0], reading)
    throttle = read_share(written[1], names[1]) if is_whole else 1.0
    point = Point(angle, throttle)
    move = move_at(point, describe(moves), reading.turns_beyond)
    return move, point if move and is_whole else None


def read_steering(value: object, name: str, reading: Reading) -> float:
    """Return the steering, from -1 to 1, after the trim has been subtracted. Raises ValueError if
    the value in the data is beyond full lock."""
    if reading.full_lock == 1.0:
        return reading.steering(read_share(value, name))
    return reading.steering(read_number(value, name))


def check_unit(written: Iterable[object], name: str, reading: Reading) -> None:
    """Raise RecordingError for steering in degrees or another unit. An import of such values would
    skip all true turns, and count even a small angle as a turn. If only a few values are too large,
    their pictures are skipped. `written` are all values of a drive."""
    found = []
    for value in written if reading.full_lock == 1.0 else ():
        with contextlib.suppress(ValueError):
            found.append(read_number(value, name))
    n_beyond = sum(abs(value) > FULL for value in found)
    if n_beyond >= max(1, min(_LEAST_BEYOND, len(found)), len(found) / _UNIT_SHARE):
        raise RecordingError(
            f"the steering in {name!r} goes from {min(found):g} to {max(found):g}, not from -1 to "
            "1; give the value of full lock with --full-lock"
        )


def read_point(written: Sequence[object], names: Sequence[str] = _STEERED) -> Point:
    """Return the steering and throttle that a program wrote; raises the errors of `read_meant`."""
    if len(written) != len(names):
        raise ValueError(f"{names[0]} is given without {names[1]}")
    return Point(*map(read_share, written, names))


def point_or_none(written: Sequence[object], names: Sequence[str] = _STEERED) -> Point | None:
    """Return the result of `read_point`, or None if the values are missing or invalid."""
    with contextlib.suppress(ValueError):
        return read_point(written, names)
    return None


def at_velocity(linear: float, turn: float, reading: Reading) -> LabelAndPoint:
    """Return the label of a velocity. `linear` is a share of full speed ahead, and `turn` a share
    of the fastest turn to the left.

    Shares beyond -1 and 1 count as full. A turn without speed is a spin.
    """
    return _turning(Point(_clipped(-turn), _clipped(linear)), reading)


def at_wheels(left: float, right: float, reading: Reading) -> LabelAndPoint:
    """Return the label of two wheel speeds, given as shares of full speed.

    The slower wheel is on the inner side: steering is the difference of the speeds divided by their
    sum, and throttle is their mean. If the wheels turn in opposite directions, the robot spins.
    """
    all_done = abs(left) + abs(right)
    steering = (left - right) / all_done if all_done else 0.0
    return _turning(Point(_clipped(steering), _clipped((left + right) / 2)), reading)


def _turning(point: Point, reading: Reading) -> LabelAndPoint:
    throttle = point.throttle if abs(point.throttle) >= _STANDING else 0.0
    point = Point(reading.steering(reading.full_lock * point.steering), throttle)
    move = move_at(point, describe(_TURNING), reading.turns_beyond)
    return move, point if move else None


def _clipped(share: float) -> float:
    return min(max(share, -1.0), 1.0) + 0.0  # adding 0.0 turns -0.0 into 0.0


def done_at(moment: EpisodeFrame, declared: Iterable[Move]) -> tuple[Action, Point | None]:
    """Return the action at a picture (the pilot's label or else the action that was sent), and the
    action's steering and throttle.

    If the pilot or the robot steered proportionally, steering and throttle are the recorded values.
    If nobody steered proportionally, they are the values that the action declares, or None if it
    declares none.
    """
    point = moment.point if moment.label else moment.sent_point
    done = moment.label or Action(moment.sent or Action.STOP)
    return done, point or point_of(done, declared)


def read_share(value: object, name: str) -> float:
    """Return a steering angle or a throttle, which may be a number or text. Raises ValueError if
    the value is not a number from -1 to 1."""
    with contextlib.suppress(ValueError):
        share = read_number(value, name)
        if -FULL <= share <= FULL:
            return min(max(share, -1.0), 1.0)
    raise ValueError(f"{name} is {str(value)[:40]!r}, not a number from -1 to 1")


def read_number(value: object, name: str) -> float:
    """Return the value of a number, which may be text; raises ValueError if the text is not a
    number."""
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        with contextlib.suppress(ValueError, OverflowError):
            number = float(value)
            if math.isfinite(number):
                return number
    raise ValueError(f"{name} is {str(value)[:40]!r}, not a number")
