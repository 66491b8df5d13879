"""A driver over one connection, which is opened, used and closed in the same way for every body."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Generic, TypeVar

from robot.clock import Clock, RealClock
from robot.driver import Driver
from robot.errors import NotConnectedError
from robot.types import Action, Point

_C = TypeVar("_C")


class ConnectedDriver(Driver, Generic[_C]):
    """Base of bodies with one connection to open: a line, a bridge, a library's motor.

    A subclass opens and closes the connection, and moves by it. This class refuses calls without a
    connection, and makes `connect` and `disconnect` idempotent.
    """

    _connection: _C | None = None

    def __init__(self, options: Any = None, clock: Clock | None = None) -> None:
        self.options = options
        self._clock = clock or RealClock()

    @abstractmethod
    def _open(self) -> _C:
        """Return the connection; raises as `connect` does."""

    def _begin(self) -> None:
        """Greet the body, and make sure that nothing moves; an error disconnects it again."""

    @abstractmethod
    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        """Move, or stand; by degrees if there is a point, which only bodies get that take points.

        The arguments have been checked.
        """

    def _close(self, connection: _C) -> None:
        """Close the connection; a body that lives only in memory has none to close."""

    def _connected(self) -> _C:
        if self._connection is None:
            raise NotConnectedError(
                f"the robot {self.name!r} is not connected; call connect() first"
            )
        return self._connection

    @property
    def is_connected(self) -> bool:
        return self._connection is not None

    def connect(self) -> None:
        if self._connection is None:
            self._connection = self._open()
            try:
                self._begin()
            except BaseException:
                self.disconnect()
                raise

    def disconnect(self) -> None:
        self.stop()
        connection, self._connection = self._connection, None
        if connection is not None:
            self._close(connection)

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        return self.__send(action, None, speed_scale)

    def send_point(self, point: Point, *, speed_scale: float = 1.0) -> Action:
        if not self.takes_points:
            return super().send_point(point, speed_scale=speed_scale)
        action = self.move_of(point)
        return self.__send(action, None if action is Action.STOP else point, speed_scale)

    def __send(self, action: Action, point: Point | None, speed_scale: float) -> Action:
        self.check_action(action, speed_scale)
        self._connected()
        self._drive(action, point, speed_scale)
        return action
