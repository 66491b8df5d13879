"""Steering angles of cars, as other programs write them, and the moves that they count as."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence

from robot.driver import TURNS_BEYOND, Move, describe, move_at, point_of
from robot.recordings.editing import EpisodeFrame
from robot.types import DEFAULT_MOVES, Action, Point

DEFAULT_THRESHOLD = TURNS_BEYOND
"""Share of full lock from which on a car is said to turn."""

ANGLES = ("angle", "steering", "user/angle", "steering_angle")
THROTTLES = ("throttle", "user/throttle")
"""What other programs call them."""
_STEERED = "the angle", "the throttle"
Meant = tuple[Action | None, Point | None]
"""A label, and the same by degrees where it is known."""
Said = tuple[Action | None, Point | None, Point | None]
"""A label, the same by degrees where it was meant so, and what it does where that is known."""


def read_meant(
    written: Sequence[object],
    threshold: float = DEFAULT_THRESHOLD,
    names: Sequence[str] = _STEERED,
) -> Meant:
    """Return what a car's driver meant: FORWARD, LEFT or RIGHT; None if it stands or backs up.

    `written` are angle (-1: full left) and throttle as a program wrote them under these names, or
    the angle alone: then the move has no point. An angle beyond the threshold is a turn. ValueError
    if one of them is no number from -1 to 1.
    """
    is_whole = len(written) == 2
    point = read_point(written if is_whole else [*written, 1.0], names)
    move = move_at(point, describe(DEFAULT_MOVES), threshold)
    return move, point if move and is_whole else None


def read_point(written: Sequence[object], names: Sequence[str] = _STEERED) -> Point:
    """Return steering and throttle as a program wrote them; raises as `read_meant` does."""
    if len(written) != len(names):
        raise ValueError(f"{names[0]} is there without {names[1]}")
    return Point(*map(read_share, written, names))


def point_said(written: Sequence[object], names: Sequence[str] = _STEERED) -> Point | None:
    """Return the same, or None where nothing that can be believed was written."""
    with contextlib.suppress(ValueError):
        return read_point(written, names)
    return None


def done_at(moment: EpisodeFrame, declared: Iterable[Move]) -> tuple[Action, Point | None]:
    """Return what was right at a picture, the pilot's label or else what was sent, and its point.

    The point is what was meant by degrees, or the move's own; None if the move has none.
    """
    by_degrees = moment.point if moment.label else moment.sent_point
    done = moment.label or Action(moment.sent or Action.STOP)
    return done, by_degrees or point_of(done, declared)


def read_share(value: object, name: str) -> float:
    """Return a steering angle or a throttle as a program wrote it, as a number or its text;
    ValueError if it is not a number from -1 to 1: nothing is put in its place."""
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        with contextlib.suppress(ValueError, OverflowError):
            share = float(value)
            if -1.0 <= share <= 1.0:
                return share
    raise ValueError(f"{name} is {str(value)[:40]!r}, not a number from -1 to 1")
