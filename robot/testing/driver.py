"""A fake driver that only records its commands."""

from __future__ import annotations

from typing import Any, ClassVar

from robot.clock import Clock, RealClock
from robot.devices.options import Options
from robot.driver import ACTION_TIMEOUT_S, BodyButton, Driver, Sensors
from robot.errors import DriveError
from robot.types import Action, Point


class FakeDriver(Driver):
    """Records commands and their times. The driver ends each move by itself, and can be made to
    fail.

    Attributes:
        sent: Every action sent, with its speed scale.
        takes_points: True for a body that accepts steering and throttle; tests set this.
        point: The steering and throttle sent last; None after a move, or if no order was sent.
        changes: The times (seconds of `clock`) at which the action changed, with the new actions.
        moved_s: The time at which the last move was received.
        stops: Number of calls of `stop`.
        failure: The message of the DriveError that `send_action` raises; None means no error.
        sensors: The readings that `sense` returns.
        button: The value that the next `take_button` returns.

    Example:
        >>> body = FakeDriver()
        >>> body.failure = "the cable is out"
        >>> body.send_action(Action.LEFT)
        Traceback (most recent call last):
        robot.errors.DriveError: the cable is out
    """

    name: ClassVar[str] = "fake"
    default_camera: ClassVar[str] = "fake"
    options_type: ClassVar[type[Any]] = Options

    def __init__(self, options: Any = None, clock: Clock | None = None) -> None:
        self.clock = clock or RealClock()
        self.sent: list[tuple[Action, float]] = []
        self.point: Point | None = None
        self.changes: list[tuple[float, Action]] = []
        self.moved_s = 0.0
        self.stops = 0
        self.failure: str | None = None
        self.sensors = Sensors()
        self.button: BodyButton | None = None
        self._told = Action.STOP
        self._told_s = 0.0

    @property
    def now(self) -> Action:
        """The body's current move; STOP once the last move is `ACTION_TIMEOUT_S` old."""
        is_over = self.clock.now_s() - self._told_s > ACTION_TIMEOUT_S
        return Action.STOP if is_over else self._told

    @property
    def is_connected(self) -> bool:
        return True

    def connect(self) -> None:
        """Do nothing, because there is no connection to open."""

    def disconnect(self) -> None:
        self.stop()

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        if self.failure is not None:
            raise DriveError(self.failure)
        self.sent.append((action, speed_scale))
        self._note(action)
        if action is not Action.STOP:
            self.moved_s = self._told_s
        return action

    def send_point(self, point: Point, *, speed_scale: float = 1.0) -> Action:
        action = super().send_point(point, speed_scale=speed_scale)
        self.point = point if self.takes_points else None
        return action

    def sense(self) -> Sensors:
        return self.sensors

    def stop(self) -> None:
        self.stops += 1
        self._note(Action.STOP)

    def take_button(self) -> BodyButton | None:
        button, self.button = self.button, None
        return button

    def _note(self, action: Action) -> None:
        self.point, now_s = None, self.clock.now_s()
        if action is not self._told:
            self.changes.append((now_s, action))
        self._told, self._told_s = action, now_s
