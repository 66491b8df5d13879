"""Makes a robot that Drivelesson serves available to LeRobot, as a robot and a teleoperator."""

from lerobot_robot_drivelesson.page import DrivelessonPage, DrivelessonPageConfig
from lerobot_robot_drivelesson.robot import DrivelessonRobot, DrivelessonRobotConfig

__all__ = ["DrivelessonPage", "DrivelessonPageConfig", "DrivelessonRobot", "DrivelessonRobotConfig"]
