"""Runs the third-party client `roslibpy` with a rosbridge; its folder is on the path.

Prints `ready` when it listens to /cmd_vel, publishes one velocity, and prints each velocity that it
receives, until it is killed.
"""

from __future__ import annotations

import json
import sys

import roslibpy


def main() -> None:
    host, _, port = sys.argv[1].partition(":")
    ros = roslibpy.Ros(host, int(port))
    ros.run(timeout=20)
    heard = roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/Twist")
    heard.subscribe(lambda message: print(json.dumps(dict(message)), flush=True))
    told = roslibpy.Topic(ros, "/cmd_vel_foreign", "geometry_msgs/Twist")
    told.advertise()
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    told.publish(roslibpy.Message({"linear": {**zero, "x": 0.25}, "angular": zero}))
    print("ready", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main()
