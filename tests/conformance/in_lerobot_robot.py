"""Runs with LeRobot: drives a served robot by random actions, as one of LeRobot's robots.

    python in_lerobot_robot.py ADDRESS MINUTES

Prints the orders, those while the robot stood, and those that did not do what was asked for.
"""

from __future__ import annotations

import random
import sys
import time

from lerobot.robots.utils import make_robot_from_config
from lerobot_robot_drivelesson import DrivelessonRobotConfig

address, minutes = sys.argv[1], float(sys.argv[2])
config = DrivelessonRobotConfig(address=address, id="random", restarts=True)
robot, chance = make_robot_from_config(config), random.Random(1)
robot.connect()
orders = standing = 0
end_s = time.monotonic() + 60 * minutes
while time.monotonic() < end_s:
    begun_s = time.monotonic()
    observed = robot.get_observation()
    assert observed["front"].shape == (120, 160, 3)
    steering, throttle = chance.uniform(-1.2, 1.2), chance.choice([0.0, 0.5, -0.5, 1.0, None])
    action = {"steering.pos": steering}
    if throttle is not None:
        action["throttle.vel"] = throttle
    returned = robot.send_action(action)
    assert set(returned) == {"steering.pos", "throttle.vel"}
    orders += 1
    standing += robot._line.state["mode"] != "train"
    time.sleep(max(0.0, 0.1 - (time.monotonic() - begun_s)))
robot.disconnect()
print(f"{orders} orders, {standing} while the robot stood")
