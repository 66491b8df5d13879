"""Motors on pins; each move ends by itself. Pure: the time is an argument."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from robot.bodies.remote.orders import BodyReport
from robot.bodies.remote.plain import LATE_MS, LONGEST_MS, parse_plain_order
from robot.devkit.wheels import CLASSIC_POINTS, USUAL_THROTTLE, Pair, TwoWheels
from robot.driver import Sensors
from robot.types import Action, Point


class PinMotor(Protocol):
    """A motor or a servo with gpiozero's interface."""

    value: float
    """Speed or position, from -1 (full speed backward, or one end of the servo) to 1. The value 0
    stops the motor."""


Build = Callable[[Point, float], Pair]
"""Function that converts a `Point` and a share of full speed to the values of the two motors, each
from -1 to 1."""


def tracked(straight_speed: float, turn_speed: float) -> Build:
    """Return the `Build` of a robot that steers by the difference of its wheels' speeds.

    The arguments are shares of full speed.
    """
    ahead, turn = straight_speed, turn_speed
    wheels = TwoWheels(ahead=ahead, back=ahead, turn=(0.0, turn), spin=turn)

    def values(point: Point, speed: float) -> Pair:
        left, right = wheels.at(point, (1.0, 1.0))
        return left * speed, right * speed

    return values


def steered(straight_speed: float, turn_speed: float, servo_ends: Pair) -> Build:
    """Return the `Build` of a car: for an ESC (electronic speed control) and a steering servo.

    `servo_ends` are the servo's values at full left and full right; straight is between them.
    """
    left, right = servo_ends

    def values(point: Point, speed: float) -> Pair:
        steer = abs(point.steering)
        full = (1.0 - steer) * straight_speed + steer * turn_speed
        throttle = max(-1.0, min(1.0, point.throttle / USUAL_THROTTLE * full))
        return throttle * speed, (left + right + point.steering * (right - left)) / 2

    return values


class TimedMotors:
    """Drives motors by text orders in the format of `robot.bodies.remote.plain`. An order that
    arrives twice is obeyed once, and an order that arrives late ends early.

    Args:
        motors: The left and the right motor, or the ESC and the servo.
        bumped: Reads the bumper; None if there is none.
        signs: Factors of the motors' values: -1 for a reversed motor.
    """

    def __init__(
        self,
        motors: Sequence[PinMotor],
        build: Build,
        bumped: Callable[[], bool] | None = None,
        signs: Sequence[float] = (1.0, 1.0),
    ) -> None:
        self._motors, self._build, self._bumped = motors, build, bumped
        self._signs = signs
        self._seq = 0
        self._ends_ms: int | None = None
        self.stand()

    def stand(self) -> None:
        self._ends_ms = None
        self._set(CLASSIC_POINTS[Action.STOP], 1.0)

    def left_ms(self, now_ms: int) -> int | None:
        """Return the time until the move must end, in milliseconds; None if no motor turns."""
        return None if self._ends_ms is None else max(0, self._ends_ms - now_ms)

    def tick(self, now_ms: int) -> None:
        """End the move if its time is over. Call this before any other method."""
        if self.left_ms(now_ms) == 0:
            self.stand()

    def obey(self, line: bytes, now_ms: int) -> BodyReport:
        """Execute the order in a line of text, and return a report of the body's state. A line that
        is not an order only requests the report."""
        self.tick(now_ms)
        order = parse_plain_order(line, CLASSIC_POINTS)
        if order is not None and order.seq > self._seq:
            self._seq = order.seq
            # A move ends at most `LATE_MS` after the report that its order names (`seen_ms`).
            # A late order therefore moves the robot for a shorter time.
            left_ms = min(order.for_ms, LONGEST_MS, LATE_MS - (now_ms - order.seen_ms))
            if order.move is Action.STOP or left_ms <= 0:
                self.stand()
            else:
                self._set(order.point or CLASSIC_POINTS[order.move], order.speed)
                self._ends_ms = now_ms + left_ms
        bumped = self._bumped() if self._bumped is not None else None
        return BodyReport(seq=self._seq, ms=now_ms, sensors=Sensors(bumped=bumped))

    def _set(self, point: Point, speed: float) -> None:
        values = self._build(point, speed)
        for motor, value, sign in zip(self._motors, values, self._signs, strict=True):
            motor.value = sign * value
