"""A robot that Drivelesson serves, as a robot and a teleoperator of LeRobot."""

from lerobot_robot_drivelesson.page import DrivelessonPage, DrivelessonPageConfig
from lerobot_robot_drivelesson.robot import DrivelessonRobot, DrivelessonRobotConfig

__all__ = ["DrivelessonPage", "DrivelessonPageConfig", "DrivelessonRobot", "DrivelessonRobotConfig"]
