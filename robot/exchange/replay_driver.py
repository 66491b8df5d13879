"""A stand-in for a robot's body, used when a recording is replayed. The stand-in has no hardware,
and only stores the last action."""

from __future__ import annotations

from typing import Any, ClassVar

from robot.devices.options import Options
from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, Sensors
from robot.types import Action, Point


class ReplayDriver(ConnectedDriver[bool]):
    """A body without motors and sensors. The recording is chosen by the camera's options."""

    name: ClassVar[str] = "replay"
    default_camera: ClassVar[str] = "replay"
    options_type: ClassVar[type[Any]] = Options
    _action = Action.STOP
    _ends_s = 0.0

    @property
    def action(self) -> Action:
        """The action that a real body would be doing now: the last action, until its time is
        over."""
        return self._action if self._clock.now_s() < self._ends_s else Action.STOP

    def _open(self) -> bool:
        return True

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        self._action = action
        self._ends_s = self._clock.now_s() + ACTION_TIMEOUT_S

    def sense(self) -> Sensors:
        return Sensors()

    def stop(self) -> None:
        self._action = Action.STOP
