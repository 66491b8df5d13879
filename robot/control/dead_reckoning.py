"""Where a robot is that does not know it: reckoned from its wheels, from where it started. Pure.

By the wheels' own counts where the driver reads them, else by what the motors were told, which
knows neither slip nor walls. Either way it is an estimate that drifts; the pose says so.
"""

from __future__ import annotations

import math
from dataclasses import replace

from robot.driver import ACTION_TIMEOUT_S, Driver
from robot.types import Action, Point, Pose, Sensors

_START = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0, is_estimate=True)


class DeadReckoning:
    """Follows one driver. Call `locate` once a tick and `told` after each action, in turn."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._pose = _START
        self._wheels_m: tuple[float, float] | None = None
        self._told: tuple[float, float] = (0.0, 0.0)
        self._told_s: float | None = None

    def locate(self, sensors: Sensors, now_s: float) -> Sensors:
        """Return the readings with an estimated pose, unless they have one or nothing is known."""
        track_m = self._driver.track_m
        if sensors.pose is not None or track_m is None:
            return sensors
        left_m, right_m = self._way(sensors.wheels_m, now_s)
        self._pose = _moved(self._pose, left_m, right_m, track_m)
        return replace(sensors, pose=self._pose)

    def told(self, action: Action, speed_scale: float, point: Point | None = None) -> None:
        """Note what the motors were just told."""
        by_degrees = () if point is None else (point,)
        left_mps, right_mps = self._driver.wheels_mps(action, *by_degrees) or (0.0, 0.0)
        self._told = left_mps * speed_scale, right_mps * speed_scale

    def _way(self, wheels_m: tuple[float, float] | None, now_s: float) -> tuple[float, float]:
        """Return how far each wheel rolled since the last call."""
        before_m, self._wheels_m = self._wheels_m, wheels_m
        before_s, self._told_s = self._told_s, now_s
        if wheels_m is not None:
            if before_m is None:
                return 0.0, 0.0
            return wheels_m[0] - before_m[0], wheels_m[1] - before_m[1]
        # A body that is not told again stops by itself.
        seconds = 0.0 if before_s is None else min(max(now_s - before_s, 0.0), ACTION_TIMEOUT_S)
        return self._told[0] * seconds, self._told[1] * seconds


def _moved(pose: Pose, left_m: float, right_m: float, track_m: float) -> Pose:
    """Return the pose after an arc on which each wheel rolled so far."""
    if left_m == right_m == 0.0:
        return pose
    turn_rad, way_m = (right_m - left_m) / track_m, (left_m + right_m) / 2
    middle_rad = pose.heading_rad + turn_rad / 2
    return replace(
        pose,
        x_m=pose.x_m + way_m * math.cos(middle_rad),
        y_m=pose.y_m + way_m * math.sin(middle_rad),
        heading_rad=math.remainder(pose.heading_rad + turn_rad, math.tau),
    )
