"""Steering angles of cars, as other programs write them, and the moves that they count as."""

from __future__ import annotations

from robot.driver import TURNS_BEYOND, describe, move_at
from robot.errors import ConfigurationError
from robot.types import DEFAULT_MOVES, Action, Point

DEFAULT_THRESHOLD = TURNS_BEYOND
"""Share of full lock from which on a car is said to turn."""


def to_move(
    angle: float, throttle: float | None = None, threshold: float = DEFAULT_THRESHOLD
) -> Action | None:
    """Return the move of a steering angle.

    Args:
        angle: From -1 (full left) to 1 (full right).
        throttle: From -1 to 1; None if it is not known.
        threshold: An angle beyond it is a turn.

    Returns:
        FORWARD, LEFT or RIGHT; None for a car that stands or drives backward.
    """
    point = Point(angle, 1.0 if throttle is None else throttle)
    return move_at(point, describe(DEFAULT_MOVES), threshold)


def read_share(value: object, name: str) -> float:
    """Return a steering angle or a throttle as a program wrote it, as a number or its text.

    Raises:
        ValueError: If it is not a number from -1 to 1: nothing is put in its place.
    """
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        share = float(value)
        if not -1.0 <= share <= 1.0:
            raise ValueError
    except (ValueError, OverflowError):
        raise ValueError(f"{name} is {str(value)[:40]!r}, not a number from -1 to 1") from None
    return share


def check_threshold(threshold: float) -> float:
    """Return the threshold.

    Raises:
        ConfigurationError: If it does not lie between 0 and 1.
    """
    if not 0.0 <= threshold < 1.0:
        raise ConfigurationError(f"--threshold must lie between 0 and 1, not {threshold:g}")
    return threshold
