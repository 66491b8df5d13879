"""Steering and throttle beside a move, as recordings and the journal keep them."""

from __future__ import annotations

from typing import Any

from robot.errors import RecordingError
from robot.types import Point


def describe_point(point: Point | None) -> dict[str, Any]:
    """Describe a point beside its move; nothing where there is none."""
    return {} if point is None else point._asdict()


def read_point(plain: dict[str, Any]) -> Point | None:
    """Read what `describe_point` wrote.

    Raises:
        RecordingError: If it is half a point, or out of range.
    """
    numbers = [plain.get(name) for name in Point._fields]
    if numbers == [None, None]:
        return None
    shares = [float(n) for n in numbers if isinstance(n, int | float) and -1.0 <= n <= 1.0]
    if len(shares) < len(numbers):
        raise RecordingError(f"a recorded point is damaged: {numbers}")
    return Point(*shares)
