"""The brick that this program runs on: its motors and sensors through python-ev3dev2."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

from robot.bodies.ev3.agent.body import BrickBody
from robot.bodies.ev3.chassis import ChassisBody, ChassisDriver, ChassisOptions
from robot.devices.options import option
from robot.errors import MissingExtraError


@dataclass(frozen=True, slots=True, kw_only=True)
class Ev3Options(ChassisOptions):
    """How the robot is built, and where its devices are."""

    brick_root: str = option("/", "folder that holds the brick's sys and dev")


class Ev3Driver(ChassisDriver):
    """A Lego Mindstorms EV3 that runs the server itself."""

    name: ClassVar[str] = "ev3"
    options_type: ClassVar[type[Any]] = Ev3Options
    options: Ev3Options

    def _make_body(self) -> ChassisBody:
        if importlib.util.find_spec("ev3dev2") is None:
            raise MissingExtraError("driving an EV3", "ev3")
        clock = SimpleNamespace(monotonic=self._clock.now_s, sleep=self._clock.sleep)
        return BrickBody(self.options.ports(), self.options.brick_root, clock)
