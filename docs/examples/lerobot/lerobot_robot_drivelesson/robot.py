"""A served robot as LeRobot's robot: it sees a picture and what it does, and is told what to do."""

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
    """Where the robot is served.

    Attributes:
        address: Of its page.
        token: Of its pairing address, once; then this computer is known.
        width, height: The picture is brought to this size.
        drives: False: somebody drives from the page, and this only looks on.
        restarts: Start again by itself after a stop, except an emergency stop.
    """

    address: str = "http://127.0.0.1:8000"
    token: str = ""
    width: int = 160
    height: int = 120
    drives: bool = True
    restarts: bool = False


class DrivelessonRobot(Served, Robot):
    """Drives by the move that is nearest to what is asked for."""

    config_class = DrivelessonRobotConfig
    name = "drivelesson"

    def __init__(self, config: DrivelessonRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras = {"front": None}  # LeRobot counts them, to know how much it has to write
        self._started_s = -math.inf

    @property
    def observation_features(self) -> dict[str, Any]:
        picture = (self.config.height, self.config.width, 3)
        return {"front": picture, **dict.fromkeys(ACTION, float)}

    def connect(self, calibrate: bool = True) -> None:
        """Connect, and have the robot wait for a pilot's moves.

        Raises:
            ConnectionError: If another has the wheel, or the robot does not start; says why.
        """
        self._dial(drives=self.config.drives)
        self._started_s = time.monotonic()

    def get_observation(self) -> dict[str, Any]:
        """Return the next picture, and what the robot does meanwhile."""
        line, size = self._open_line(), (self.config.width, self.config.height)
        picture = cv2.resize(line.picture(), size, interpolation=cv2.INTER_AREA)
        return {"front": picture, **dict(zip(ACTION, line.point(), strict=True))}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Hold the nearest move; return steering and throttle of what the robot really does."""
        line = self._open_line()
        if not self.config.drives:
            return dict(zip(ACTION, line.point(), strict=True))
        done = line.drive(action)
        if line.state["mode"] != "train" or not line.state["you_are_pilot"]:
            self._start_again(line)
        return dict(zip(ACTION, done, strict=True))

    def _start_again(self, line: Line) -> None:
        """Say that the robot stands, and start it if that is wanted; once a second at most."""
        state = line.state
        line.warn("%s stands: %s", line.robot, line.why_it_stands)
        is_ours = state["you_are_pilot"] and not state["emergency"]
        if self.config.restarts and is_ours and time.monotonic() - self._started_s >= _AGAIN_S:
            self._started_s = time.monotonic()
            line.choose("train")

    def _open_line(self) -> Line:
        if self._line is None:
            raise ConnectionError("connect the robot first")
        return self._line
