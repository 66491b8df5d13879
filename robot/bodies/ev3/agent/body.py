"""The body of the brick: motors, sensors, buttons, lights and screen, opened together."""

import time
from typing import Any, Dict, List

from robot.bodies.ev3.agent.console import Console
from robot.bodies.ev3.agent.motors import MotorPair
from robot.bodies.ev3.agent.ports import DriveError
from robot.bodies.ev3.agent.sensors import RobotSensors


class BrickBody:
    """The motors, sensors and console of the brick, as one body.

    `open` finds the devices. Every failure raises DriveError. `ports` maps `left`, `right`,
    `ultrasonic` and `touch` to their ports. `clock` has the functions of the module `time`.
    """

    def __init__(self, ports: Dict[str, Any], root: str = "/", clock: Any = time) -> None:
        self.motors = MotorPair(ports["left"], ports["right"], root, clock)
        self.sensors = RobotSensors(ports["ultrasonic"], ports["touch"], root, clock)
        self.console = Console(root)
        self.run, self.stop = self.motors.run, self.motors.stop
        self.positions = self.motors.positions
        self.take_button, self.show = self.console.take_button, self.console.show

    def open(self) -> List[float]:
        """Find motors, sensors, battery and buttons, and stop the motors.

        Returns the top speeds of the left and the right wheel, in degrees a second.
        """
        try:
            self.motors.open()
            self.sensors.open()
            self.console.open()
        except DriveError:
            raise
        except Exception as error:
            raise DriveError(
                "the brick's devices cannot be used ({}); run as root, or as a member of the group "
                "ev3dev".format(error)
            ) from error
        return self.motors.top_speeds_dps()

    def sense(self) -> Dict[str, Any]:
        """Return the values of `RobotSensors.read`, and wheels_deg, the angles by which the wheels
        have turned; wheels_deg is None if a motor does not answer."""
        read = self.sensors.read()
        try:
            read["wheels_deg"] = self.motors.positions()
        except DriveError:  # the next move reports the same error
            read["wheels_deg"] = None
        return read

    def close(self) -> None:
        self.stop()
        self.motors.close()
        self.sensors.close()
        self.console.close()
