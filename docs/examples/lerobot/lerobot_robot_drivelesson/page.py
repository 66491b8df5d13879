"""Makes the pilot at the robot's page a LeRobot teleoperator: the pilot's move is the action."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from lerobot_robot_drivelesson.line import Served
from lerobot_robot_drivelesson.nearest import ACTION, STANDS


@TeleoperatorConfig.register_subclass("drivelesson_page")
@dataclass(kw_only=True)
class DrivelessonPageConfig(TeleoperatorConfig):
    """The address of the served robot. Start the LeRobot robot with `--robot.drives=false`."""

    address: str = "http://127.0.0.1:8000"
    token: str = ""


class DrivelessonPage(Served, Teleoperator):
    """Returns the pilot's moves as actions."""

    config_class = DrivelessonPageConfig
    name = "drivelesson_page"

    def __init__(self, config: DrivelessonPageConfig) -> None:
        super().__init__(config)
        self.config = config

    @property
    def feedback_features(self) -> dict[str, type]:
        return {}

    def connect(self, calibrate: bool = True) -> None:
        """Connect without driving."""
        self._dial(drives=False)

    def get_action(self) -> dict[str, Any]:
        """Return steering and throttle of the pilot's current move; both zero without a pilot."""
        assert self._line is not None, "connect first"
        is_pilots = self._line.state["driven_by"] == "pilot"
        point = self._line.point() if is_pilots else STANDS
        return dict(zip(ACTION, point, strict=True))

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing."""
