"""The base class of drivers that reach their body over one connection, which the class opens,
closes and reopens."""

from __future__ import annotations

import contextlib
import inspect
from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from robot.clock import Clock, RealClock
from robot.driver import Driver, Sensors
from robot.errors import DriveError, NotConnectedError, RobotError, reason
from robot.types import Action, Point

_C = TypeVar("_C")
_T = TypeVar("_T")
AGAIN_S = 0.01, 0.5
"""First and longest pause between attempts to open a lost connection again, in seconds. Each failed
attempt doubles the pause."""
_BROKEN = OSError, EOFError


class _Shown:
    """A public name for a private attribute of the base class, for subclasses. The base class uses
    only the private name, so a subclass may use the public one for something else."""

    def __init__(self, name: str) -> None:
        self.name = f"_ConnectedDriver__{name}"

    def __get__(self, driver: Any, kind: Any) -> Any:
        return getattr(driver, self.name, None)


class ConnectedDriver(Driver, Generic[_C]):
    """Base class of drivers with one connection: a serial line, a bridge, a library's motor.

    A subclass implements `_open`, `_drive` and `_close`, and `_sense` if the body has sensors. A
    subclass need not catch OSError and EOFError: this class reports them as DriveErrors and closes
    the connection, and the next request opens the connection again. This class also refuses calls
    without a connection, makes `connect` and `disconnect` idempotent, and stops the body after each
    `_begin`.

    If the body answers each order, nothing else is needed. If the body sends reports but does not
    acknowledge orders, set `gone_after_s`, and call `heard` whenever data arrives from the body.

    Attributes:
        gone_after_s: Time without a call of `heard` after which the body counts as gone, in
            seconds. The time must be longer than the gaps between reports, and at most 0.4, so that
            the error comes within half a second. None if the body answers each request.
    """

    gone_after_s: ClassVar[float | None] = None

    __connection: _C | None = None
    __is_wanted = False
    __again_s = 0.0
    __pause_s = AGAIN_S[0]
    __heard_s = float("-inf")
    __trouble = ""
    __clock: Clock = RealClock()
    __opening = __clock.lock()
    if TYPE_CHECKING:
        _connection: _C | None
        _clock: Clock
    else:
        _connection, _clock = _Shown("connection"), _Shown("clock")

    def __init__(self, options: Any = None, clock: Clock | None = None) -> None:
        self.options = options
        self.__clock = clock or RealClock()
        self.__opening = self.__clock.lock()

    def __init_subclass__(cls, **options: Any) -> None:
        """Refuse a subclass in which a method accidentally replaces one of the base class.

        Raises:
            TypeError: If an overriding method does not accept the overridden method's arguments.
        """
        super().__init_subclass__(**options)
        for name, theirs in vars(cls).items():
            ours = next((vars(base)[name] for base in cls.__mro__[1:] if name in vars(base)), None)
            if inspect.isfunction(ours) and name != "__init__" and not _takes_calls(theirs, ours):
                given = str(inspect.signature(theirs)) if callable(theirs) else f" = {theirs!r}"
                raise TypeError(
                    f"{cls.__name__}.{name}{given} replaces a method that Drivelesson calls with "
                    f"arguments {inspect.signature(ours)}; choose another name for yours"
                )

    @abstractmethod
    def _open(self) -> _C:
        """Return a new connection; raises the errors of `connect`."""

    def _begin(self) -> None:
        """Start the communication after each `_open`; an error closes the connection again."""

    @abstractmethod
    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        """Send a move or STOP. `point` is only given to bodies that accept points.

        The base class has checked the arguments.
        """

    def _sense(self) -> Sensors:
        """Read the sensors and all other data from the body; by default there are no sensors.

        If the body sends reports by itself, the method must not wait for them. The base class also
        calls this method before a move if `heard` was not called in the last `gone_after_s`
        seconds.
        """
        return Sensors()

    def _close(self, connection: _C) -> None:
        """Close the connection. The default does nothing, as for a simulated body."""

    def heard(self) -> None:
        """Record that data arrived from the body (see `gone_after_s`). Any thread may call this.

        If `gone_after_s` is set, `_begin` must wait until data has arrived from the body.
        """
        self.__heard_s = self.__clock.now_s()

    def _connected(self) -> _C:
        """Return the connection, for the subclass's code.

        Raises:
            NotConnectedError: Before `connect`.
            DriveError: While the connection is lost.
        """
        if self.__connection is None:
            if self.__is_wanted:
                raise DriveError(self.__trouble)
            raise NotConnectedError(
                f"the robot {self.name!r} is not connected; call connect() first"
            )
        return self.__connection

    @property
    def is_connected(self) -> bool:
        return self.__is_wanted or self.__connection is not None

    def connect(self) -> None:
        with self.__opening:
            if not self.__is_wanted:
                self.__open()
                self.__is_wanted = True

    def disconnect(self) -> None:
        self.stop()
        self.__is_wanted = False
        self.__hang_up()

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        return self.__send(action, None, speed_scale)

    def send_point(self, point: Point, *, speed_scale: float = 1.0) -> Action:
        if not self.takes_points:
            return super().send_point(point, speed_scale=speed_scale)
        action = self.move_of(point)
        return self.__send(action, None if action is Action.STOP else point, speed_scale)

    def sense(self) -> Sensors:
        sensors = self.__ask(self._sense)
        self.__check_heard()
        return sensors

    def stop(self) -> None:
        if self.__connection is not None:
            with contextlib.suppress(DriveError):  # the next request reports the error
                self.__ask(partial(self._drive, Action.STOP, None, 1.0))

    def __send(self, action: Action, point: Point | None, speed_scale: float) -> Action:
        self.check_action(action, speed_scale)
        drive = partial(self._drive, action, point, speed_scale)
        if action is not Action.STOP:
            self.__check_heard(self._sense)
        self.__ask(drive)
        return action

    def __ask(self, request: Callable[[], _T]) -> _T:
        """Do one request; if the connection was lost, open it again first."""
        self.__reach()
        try:
            return request()
        except RobotError:  # not converted, although DriveError is also an OSError
            raise
        except _BROKEN as error:
            raise self.__lose(f"does not answer: {reason(error)}") from error

    def __reach(self) -> None:
        if self.__connection is not None:
            return
        with self.__opening:
            if self.__connection is None:
                if not self.__is_wanted or self.__clock.now_s() < self.__again_s:
                    ConnectedDriver._connected(self)  # this call raises the connection's error
                self.__open()

    def __open(self) -> None:
        try:
            self.__connection = self._open()
            self._begin()
            self._drive(Action.STOP, None, 1.0)
            self.__pause_s = AGAIN_S[0]
        except BaseException as error:
            self.__again_s = self.__clock.now_s() + self.__pause_s
            self.__pause_s = min(2 * self.__pause_s, AGAIN_S[1])
            self.__hang_up()
            if isinstance(error, _BROKEN) and not isinstance(error, RobotError):
                raise self.__lose(f"cannot be reached: {reason(error)}") from error
            self.__trouble = str(error)
            raise

    def __lose(self, why: str) -> DriveError:
        self.__trouble = f"the robot {self.name!r} {why}; is it switched on and in range?"
        self.__hang_up()
        return DriveError(self.__trouble)

    def __hang_up(self) -> None:
        with self.__opening:
            connection, self.__connection = self.__connection, None
            if connection is not None:
                with contextlib.suppress(*_BROKEN):  # the connection may already be broken
                    self._close(connection)

    def __check_heard(self, listen: Callable[[], object] | None = None) -> None:
        """Read once more, and raise DriveError if the body has been silent for too long."""
        if self.gone_after_s is None:
            return
        for wait in (listen, None):
            silent_s = self.__clock.now_s() - self.__heard_s
            if silent_s <= self.gone_after_s:
                return
            if wait is not None:
                self.__ask(wait)
        raise self.__lose(f"has been silent for {silent_s:.1f} s")


def clock_of(driver: ConnectedDriver[Any]) -> Clock:
    """Return the driver's clock. This function does not read `_clock`, because a subclass may use
    that name for something else."""
    clock: Clock = driver._ConnectedDriver__clock  # type: ignore[attr-defined]
    return clock


def _takes_calls(theirs: Any, ours: Callable[..., object]) -> bool:
    """Return True if `theirs` can be called with all arguments of `ours`, and with only the
    required ones. Return True for callable objects that are not plain functions."""
    if not callable(theirs):
        return isinstance(theirs, property | staticmethod | classmethod)
    if not inspect.isfunction(theirs):
        return True
    known = inspect.signature(ours).parameters.values()
    plain = [each for each in known if each.kind is not each.KEYWORD_ONLY]
    least = [each for each in plain if each.default is each.empty]
    named = {each.name: None for each in known if each.kind is each.KEYWORD_ONLY}
    try:
        inspect.signature(theirs).bind(*least)
        inspect.signature(theirs).bind(*plain, **named)
    except TypeError:
        return False
    return True
