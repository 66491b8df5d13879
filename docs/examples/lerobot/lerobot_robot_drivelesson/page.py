"""The pilot at the robot's own page, as LeRobot's teleoperator: what is held is the action."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from lerobot_robot_drivelesson.line import Served
from lerobot_robot_drivelesson.nearest import ACTION, STANDS


@TeleoperatorConfig.register_subclass("drivelesson_page")
@dataclass(kw_only=True)
class DrivelessonPageConfig(TeleoperatorConfig):
    """Where the robot is served; the robot itself takes `--robot.drives=false`."""

    address: str = "http://127.0.0.1:8000"
    token: str = ""


class DrivelessonPage(Served, Teleoperator):
    """Gives what the pilot makes the robot do."""

    config_class = DrivelessonPageConfig
    name = "drivelesson_page"

    def __init__(self, config: DrivelessonPageConfig) -> None:
        super().__init__(config)
        self.config = config

    @property
    def feedback_features(self) -> dict[str, type]:
        return {}

    def connect(self, calibrate: bool = True) -> None:
        """Look on."""
        self._dial(drives=False)

    def get_action(self) -> dict[str, Any]:
        """Return steering and throttle of what the pilot does now; zero if nobody does."""
        assert self._line is not None, "connect first"
        is_pilots = self._line.state["driven_by"] == "pilot"
        point = self._line.point() if is_pilots else STANDS
        return dict(zip(ACTION, point, strict=True))

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing."""
