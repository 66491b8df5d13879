"""A served robot as LeRobot's robot: it sees a picture and what it does, and is told what to do."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import dataclass
from typing import Any

import cv2
from lerobot.robots import Robot, RobotConfig

from lerobot_robot_drivelesson.line import ACTION, Line, Served

log = logging.getLogger(__name__)
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
        """Connect, and have the robot wait for a pilot's moves."""
        self._dial(drives=self.config.drives)
        if self.config.drives:
            self._start()

    def get_observation(self) -> dict[str, Any]:
        """Return the next picture, and what the robot does meanwhile."""
        line, size = self._open_line(), (self.config.width, self.config.height)
        picture = cv2.resize(line.picture(), size, interpolation=cv2.INTER_AREA)
        return {"front": picture, **dict(zip(ACTION, line.point(), strict=True))}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Hold the nearest move, and return its steering and throttle."""
        line = self._open_line()
        asked = tuple(float(action.get(name, 0.0)) for name in ACTION)
        points = {None: (0.0, 0.0), **line.points}
        move = min(points, key=lambda name: math.dist(points[name], asked))
        if self.config.drives:
            line.hold(move)
            if line.state["mode"] == "stopped" and move is not None:
                self._start_again()
        return dict(zip(ACTION, points[move], strict=True))

    def _start(self) -> None:
        self._started_s = time.monotonic()
        self._open_line().choose("train")

    def _start_again(self) -> None:
        if time.monotonic() - self._started_s < _AGAIN_S:
            return
        state = self._open_line().state
        log.warning("the robot stands: %s", state["fault"] or state["stop_reason"])
        if self.config.restarts and not state["emergency"]:
            self._start()

    def _open_line(self) -> Line:
        if self._line is None:
            raise ConnectionError("connect the robot first")
        return self._line
