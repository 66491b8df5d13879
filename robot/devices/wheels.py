"""From steering and throttle to two wheels that steer by their difference. Pure.

Bodies differ in the speeds of their moves alone. The points of these are those of
`robot.driver.CLASSIC`, and what lies between two points drives between them.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot.driver import CLASSIC
from robot.types import Action, Point

Pair = tuple[float, float]
"""Of the left and the right wheel."""
CLASSIC_POINTS = {Action.STOP: Point(0.0, 0.0)} | {
    name: move.point for name, move in CLASSIC.items() if move.point is not None
}
USUAL_THROTTLE = 0.5
"""Throttle of the moves that drive: twice as much is twice as fast."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoWheels:
    """How fast the wheels turn in each move, in any unit; right is left, mirrored.

    Attributes:
        ahead: Of both wheels, straight ahead.
        back: The same straight back, as a positive number.
        turn: Of the left and the right wheel in a turn to the left.
        spin: Of the right wheel in a spin to the left.
    """

    ahead: float
    back: float
    turn: Pair
    spin: float

    def at(self, point: Point, most: Pair | None = None) -> Pair:
        """Return the speeds of the wheels.

        Ahead it drives slower the more it steers, and full lock is a turn; without throttle, a
        spin. Backward the wheel on the inner side is slower, as with a car.

        Args:
            point: Where to.
            most: The fastest that each wheel can; where one would have to turn faster, both turn
                slower, and the curve stays.
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
