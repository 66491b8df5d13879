"""The body of the brick: motors, sensors, buttons, lights and screen, as one thing to open."""

import time
from typing import Any, Dict, List

from robot.bodies.ev3.agent.console import Console
from robot.bodies.ev3.agent.motors import MotorPair
from robot.bodies.ev3.agent.ports import DriveError
from robot.bodies.ev3.agent.sensors import RobotSensors


class BrickBody:
    """The brick's body: its motors and console do what they are asked through it.

    `open` finds the devices; whatever fails raises DriveError. `ports` says where `left`, `right`,
    `ultrasonic` and `touch` are, and `clock` has the functions of Python's `time`.
    """

    def __init__(self, ports: Dict[str, Any], root: str = "/", clock: Any = time) -> None:
        self.motors = MotorPair(ports["left"], ports["right"], root, clock)
        self.sensors = RobotSensors(ports["ultrasonic"], ports["touch"], root, clock)
        self.console = Console(root)
        self.run, self.stop = self.motors.run, self.motors.stop
        self.positions = self.motors.positions
        self.take_button, self.show = self.console.take_button, self.console.show

    def open(self) -> List[float]:
        """Find motors, sensors, battery and buttons, and make sure that nothing moves.

        Returns how fast each wheel can turn, in degrees a second; left, right.
        """
        try:
            self.motors.open()
            self.sensors.open()
            self.console.open()
        except DriveError:
            raise
        except Exception as error:
            raise DriveError(
                "the brick's devices cannot be used ({}); be root, or a member of the group "
                "ev3dev".format(error)
            ) from error
        return self.motors.top_speeds_dps()

    def sense(self) -> Dict[str, Any]:
        """Return distance_m, bumped, bumpers, battery_share (None for what is not there) and
        wheels_deg, how far each wheel has turned."""
        read = self.sensors.read()
        try:
            read["wheels_deg"] = self.motors.positions()
        except DriveError:  # said when the motors are asked to turn
            read["wheels_deg"] = None
        return read

    def close(self) -> None:
        self.stop()
        self.motors.close()
        self.sensors.close()
        self.console.close()
