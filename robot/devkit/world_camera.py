"""The camera of a simulated world. The camera's thread also advances the world."""

from __future__ import annotations

import threading
from abc import abstractmethod
from typing import Any, ClassVar, Generic, Self, TypeVar

from robot.clock import Clock
from robot.devkit.threaded_camera import ThreadedCamera
from robot.driver import Driver
from robot.errors import CameraError, ConfigurationError, RobotError
from robot.types import Frame

_D = TypeVar("_D", bound=Driver)


class WorldCamera(ThreadedCamera, Generic[_D]):
    """Base class of cameras of simulated worlds. The camera's thread also advances the world."""

    body_type: ClassVar[type[Any]]
    """The driver of the robot in this world."""

    longest_join_s: ClassVar[float] = 5.0
    patience_s: ClassVar[float] = 20.0
    """Longest wait for the first picture, in seconds. Some worlds load slowly."""
    _failure: RobotError | None = None

    def __init__(self, body: _D, options: Any, clock: Clock) -> None:
        super().__init__(options, clock)
        self._body = body

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        if not isinstance(driver, cls.body_type):
            raise ConfigurationError(
                f"the camera {cls.name!r} only works with the robot {cls.body_type.name!r}, "
                f"not with {driver.name!r}"
            )
        return cls(driver, options, clock)

    def _begin(self) -> None:
        """Begin to take pictures in real time; return after the first picture."""
        self._failure = None
        first = threading.Event()
        self._work(lambda: self._run(first))
        if not self.clock.wait(first, self.patience_s):
            self._failure = CameraError(f"the camera {self.name!r} gives no picture")
        if self._failure is not None:
            raise self._failure

    @abstractmethod
    def _take(self) -> Frame:
        """Take one picture."""

    @abstractmethod
    def _live(self) -> None:
        """Advance the world and take pictures until `_ending` is set."""

    @abstractmethod
    def _leave(self) -> None:
        """Close the world, on the thread that advances it."""

    def _run(self, first: threading.Event) -> None:
        try:
            self._take()
            first.set()
            self._live()
        except RobotError as error:
            self._fail(error, first)
        except (Exception, SystemExit) as error:  # the world may be a plugin that raises anything
            self._fail(CameraError(f"the world of this camera failed: {error}"), first)
        finally:
            self._leave()

    def _fail(self, error: RobotError, first: threading.Event) -> None:
        self._failure = error
        self._report_fault(str(error))
        first.set()
