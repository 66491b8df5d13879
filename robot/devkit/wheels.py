"""Converts steering and throttle to the wheel speeds of a differential drive. Pure.

Bodies differ only in the wheel speeds of their moves. The steering and throttle of each move are
those in `robot.moves.CLASSIC`. Between two moves the speeds are interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot.moves import CLASSIC
from robot.types import Action, Point

Pair = tuple[float, float]
"""One value for the left wheel, and one for the right wheel."""
CLASSIC_POINTS = {Action.STOP: Point(0.0, 0.0)} | {
    name: move.point for name, move in CLASSIC.items() if move.point is not None
}
USUAL_THROTTLE = 0.5
"""Throttle of the classic moves ahead and back. Speed is proportional to throttle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoWheels:
    """Speeds of the wheels in each move, in any unit. Moves to the right mirror the moves to the
    left.

    Attributes:
        ahead: Speed of both wheels, straight ahead.
        back: Speed of both wheels straight back, as a positive number.
        turn: Speeds of the left and the right wheel in a turn to the left.
        spin: Speed of the right wheel in a spin to the left.
    """

    ahead: float
    back: float
    turn: Pair
    spin: float

    def at(self, point: Point, most: Pair | None = None) -> Pair:
        """Return the speeds of the wheels.

        When the robot drives ahead, the speeds change linearly with the steering, from `ahead` to
        `turn` at full lock. At throttle 0 the robot spins. When it drives backward, the inner wheel
        is slower, as in a car.

        Args:
            point: Steering and throttle.
            most: Top speeds of the wheels. If a wheel would exceed its top speed, both wheels turn
                slower, and the curve stays the same.
        """
        steer, drive = abs(point.steering), abs(point.throttle) / USUAL_THROTTLE
        straight, turn = self.ahead, self.turn
        if point.throttle < 0.0:
            straight, turn = -self.back, (0.0, -self.back)
        left, right = (
            drive * ((1.0 - steer) * straight + steer * turning)
            + max(1.0 - drive, 0.0) * steer * spinning
            for turning, spinning in zip(turn, (-self.spin, self.spin), strict=True)
        )
        if point.steering > 0.0:
            left, right = right, left
        if most is not None:
            share = max(1.0, *(abs(of) / top for of, top in zip((left, right), most, strict=True)))
            left, right = left / share, right / share
        return left, right
