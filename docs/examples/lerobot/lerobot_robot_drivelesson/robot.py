"""Makes a served robot a LeRobot robot; it observes the picture, its steering and its throttle."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import cv2
from lerobot.robots import Robot, RobotConfig

from lerobot_robot_drivelesson.line import Line, Served
from lerobot_robot_drivelesson.nearest import ACTION

_AGAIN_S = 1.0


@RobotConfig.register_subclass("drivelesson")
@dataclass(kw_only=True)
class DrivelessonRobotConfig(RobotConfig):
    """The address of the served robot, and how to use the robot.

    Attributes:
        address: The address of the robot's page.
        token: The token of the pairing address; only needed until this computer is paired.
        width, height: Each picture is resized to this size, in pixels.
        drives: If false, this only observes, and somebody drives from the page.
        restarts: Restart the robot automatically after a stop, but not after an emergency stop.
    """

    address: str = "http://127.0.0.1:8000"
    token: str = ""
    width: int = 160
    height: int = 120
    drives: bool = True
    restarts: bool = False


class DrivelessonRobot(Served, Robot):
    """Drives with the robot's move that is nearest to the requested action."""

    config_class = DrivelessonRobotConfig
    name = "drivelesson"

    def __init__(self, config: DrivelessonRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras = {"front": None}  # LeRobot uses the number of cameras to size its writers
        self._started_s = -math.inf

    @property
    def observation_features(self) -> dict[str, Any]:
        picture = (self.config.height, self.config.width, 3)
        return {"front": picture, **dict.fromkeys(ACTION, float)}

    def connect(self, calibrate: bool = True) -> None:
        """Connect; if `drives` is true, also take the wheel and start the robot.

        Raises:
            ConnectionError: If another client has the wheel, or the robot does not start.
        """
        self._dial(drives=self.config.drives)
        self._started_s = time.monotonic()

    def get_observation(self) -> dict[str, Any]:
        """Return the next picture, and the robot's current steering and throttle."""
        line, size = self._open_line(), (self.config.width, self.config.height)
        picture = cv2.resize(line.picture(), size, interpolation=cv2.INTER_AREA)
        return {"front": picture, **dict(zip(ACTION, line.point(), strict=True))}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Hold the nearest move; return the steering and throttle that the robot really has."""
        line = self._open_line()
        if not self.config.drives:
            return dict(zip(ACTION, line.point(), strict=True))
        done = line.drive(action)
        if line.state["mode"] != "train" or not line.state["you_are_pilot"]:
            self._start_again(line)
        return dict(zip(ACTION, done, strict=True))

    def _start_again(self, line: Line) -> None:
        """Warn that the robot stands still; if `restarts` is set, restart it, once a second."""
        state = line.state
        line.warn("%s stands still: %s", line.robot, line.why_it_stands)
        is_ours = state["you_are_pilot"] and not state["emergency"]
        if self.config.restarts and is_ours and time.monotonic() - self._started_s >= _AGAIN_S:
            self._started_s = time.monotonic()
            line.choose("train")

    def _open_line(self) -> Line:
        if self._line is None:
            raise ConnectionError("connect the robot first")
        return self._line
