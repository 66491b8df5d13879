"""A body without hardware, for recorded footage: it remembers the last action."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from robot.clock import Clock, RealClock
from robot.driver import ACTION_TIMEOUT_S, Driver
from robot.errors import NotConnectedError
from robot.types import Action, Sensors


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOptions:
    """The body has nothing to choose; the recording is the camera's option."""


class ReplayDriver(Driver):
    """Moves nothing and senses nothing; `action` is what a body would be doing now."""

    name: ClassVar[str] = "replay"
    default_camera: ClassVar[str] = "replay"
    options_type: ClassVar[type[Any]] = ReplayOptions

    def __init__(self, options: ReplayOptions | None = None, clock: Clock | None = None) -> None:
        self._clock = clock or RealClock()
        self._is_connected = False
        self._action = Action.STOP
        self._ends_s = 0.0

    @property
    def is_connected(self) -> bool:
        """True between `connect` and `disconnect`."""
        return self._is_connected

    @property
    def action(self) -> Action:
        """What a body would be doing now: the last action, until its time is over."""
        return self._action if self._clock.now_s() < self._ends_s else Action.STOP

    def connect(self) -> None:
        """Nothing to open."""
        self._is_connected = True

    def disconnect(self) -> None:
        """Stop."""
        self.stop()
        self._is_connected = False

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        """Note the action; see `Driver`."""
        self.check_action(action, speed_scale)
        if not self._is_connected:
            raise NotConnectedError("the replayed robot is not connected; call connect() first")
        self._action = action
        self._ends_s = self._clock.now_s() + ACTION_TIMEOUT_S
        return action

    def sense(self) -> Sensors:
        """Sense nothing: a recording has pictures alone."""
        return Sensors()

    def stop(self) -> None:
        """Note that the body stands."""
        self._action = Action.STOP
