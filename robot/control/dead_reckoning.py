"""Dead reckoning: estimates a robot's pose from its wheels, relative to its start. Pure.

The wheel encoders are used if the driver reads them, else the commands to the motors, which do not
show slip or walls. Either estimate drifts, so the pose is marked as estimated.
"""

from __future__ import annotations

from dataclasses import replace

from robot.control.state import Tick
from robot.driver import ACTION_TIMEOUT_S, Driver
from robot.types import Pose, Sensors

Pair = tuple[float, float]
"""Values of the left and the right wheel."""


class DeadReckoning:
    """Follows one driver; `locate` is called once a tick."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._pose = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0, is_estimate=True)
        self._wheels_m: Pair | None = None

    def locate(self, sensors: Sensors, last: Tick, now_s: float) -> Sensors:
        """Add an estimated pose to the readings, unless they contain a pose or no motion is known.

        The motors have executed the command of the previous tick, `last`, since then.
        """
        track_m = self._driver.track_m
        if sensors.pose is not None or track_m is None:
            return sensors
        now_m = sensors.wheels_m
        before_m, self._wheels_m = self._wheels_m or now_m, now_m
        if now_m is None or before_m is None:
            left_m, right_m = self._told_m(last, now_s)
        else:
            left_m, right_m = now_m[0] - before_m[0], now_m[1] - before_m[1]
        self._pose = self._pose.along((right_m - left_m) / track_m, (left_m + right_m) / 2)
        return replace(sensors, pose=self._pose)

    def _told_m(self, last: Tick, now_s: float) -> Pair:
        """Return the distance of each wheel, computed from the commands to the motors."""
        point = last.decision.point if self._driver.takes_points else None
        by_degrees = () if point is None else (point,)
        left_mps, right_mps = self._driver.wheels_mps(last.sent, *by_degrees) or (0.0, 0.0)
        # A body without a new command stops by itself.
        seconds = min(max(now_s - last.now_s, 0.0), ACTION_TIMEOUT_S) * last.decision.speed_scale
        return left_mps * seconds, right_mps * seconds
