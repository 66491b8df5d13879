"""Two motors on pins that end each move by themselves. Pure: the time is an argument."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from robot.bodies.remote.orders import BodyReport
from robot.bodies.remote.plain import LATE_MS, LONGEST_MS, parse_plain_order
from robot.types import Action, Sensors


class PinMotor(Protocol):
    """A motor as gpiozero has it."""

    value: float
    """From -1 (full speed backward) to 1; 0 stands."""


SHARES: dict[Action, tuple[float, float]] = {
    Action.FORWARD: (1.0, 1.0),
    Action.LEFT: (0.0, 1.0),
    Action.RIGHT: (1.0, 0.0),
    Action.BACKWARD: (-1.0, -1.0),
    Action.SPIN_LEFT: (-1.0, 1.0),
    Action.SPIN_RIGHT: (1.0, -1.0),
}
"""Left and right wheel of each move."""


class TimedWheels:
    """Obeys orders of `robot.bodies.remote.plain`, each at most once and never late.

    Args:
        left: The left motor.
        right: The right motor.
        straight_speed: Share of the motors' full speed, straight on.
        turn_speed: The same for turns.
        bumped: Reads the bumper; None if there is none.
    """

    def __init__(
        self,
        left: PinMotor,
        right: PinMotor,
        straight_speed: float,
        turn_speed: float,
        bumped: Callable[[], bool] | None = None,
    ) -> None:
        self._motors = (left, right)
        self._straight_speed, self._turn_speed = straight_speed, turn_speed
        self._bumped = bumped
        self._seq = 0
        self._ends_ms: int | None = None
        self.stand()

    def stand(self) -> None:
        self._ends_ms = None
        for motor in self._motors:
            motor.value = 0.0

    def left_ms(self, now_ms: int) -> int | None:
        """Return in how many milliseconds the move must end; None if it stands."""
        return None if self._ends_ms is None else max(0, self._ends_ms - now_ms)

    def tick(self, now_ms: int) -> None:
        """End a move whose time is over; to be called before anything else is done."""
        if self.left_ms(now_ms) == 0:
            self.stand()

    def obey(self, line: bytes, now_ms: int) -> BodyReport:
        """Take one line, and report; what is no order asks for the report alone."""
        self.tick(now_ms)
        order = parse_plain_order(line, SHARES)
        if order is not None and order.seq > self._seq:
            self._seq = order.seq
            # What was sent after `seen_ms` ends by itself so long after it, whenever it comes.
            left_ms = min(order.for_ms, LONGEST_MS, LATE_MS - (now_ms - order.seen_ms))
            if order.move is Action.STOP or left_ms <= 0:
                self.stand()
            else:
                self._move(order.move, order.speed)
                self._ends_ms = now_ms + left_ms
        bumped = self._bumped() if self._bumped is not None else None
        return BodyReport(nonce="", seq=self._seq, ms=now_ms, sensors=Sensors(bumped=bumped))

    def _move(self, move: Action, speed: float) -> None:
        left, right = SHARES[move]
        full = self._straight_speed if left == right else self._turn_speed
        for motor, share in zip(self._motors, (left, right), strict=True):
            motor.value = share * full * speed
