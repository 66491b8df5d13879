"""The pilot at the robot's own page, as LeRobot's teleoperator: what is held is the action."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from lerobot_robot_drivelesson.line import Line, pair
from lerobot_robot_drivelesson.robot import ACTION


@TeleoperatorConfig.register_subclass("drivelesson_page")
@dataclass(kw_only=True)
class DrivelessonPageConfig(TeleoperatorConfig):
    """Where the robot is served; the robot itself takes `--robot.drives=false`."""

    address: str = "http://127.0.0.1:8000"
    token: str = ""


class DrivelessonPage(Teleoperator):
    """Gives what the pilot makes the robot do."""

    config_class = DrivelessonPageConfig
    name = "drivelesson_page"

    def __init__(self, config: DrivelessonPageConfig) -> None:
        super().__init__(config)
        self.config = config
        self._line: Line | None = None

    @property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys(ACTION, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        return {}

    @property
    def is_connected(self) -> bool:
        return self._line is not None and self._line.is_open

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""

    def connect(self, calibrate: bool = True) -> None:
        """Look on."""
        kept = self.calibration_dir / f"{self.id}.cookie"
        cookie = pair(self.config.address, self.config.token, kept)
        self._line = Line(self.config.address, cookie, drives=False)
        self._line.open()

    def get_action(self) -> dict[str, Any]:
        """Return steering and throttle of what the pilot does now; zero if nobody does."""
        assert self._line is not None, "connect first"
        is_pilots = self._line.state["driven_by"] == "pilot"
        point = self._line.point() if is_pilots else (0.0, 0.0)
        return dict(zip(ACTION, point, strict=True))

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Stop looking on."""
        if self._line is not None:
            self._line.close()
            self._line = None
