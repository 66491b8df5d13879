"""Dead reckoning: estimates a robot's pose from its wheels, relative to its start. Pure.

The estimate uses the wheel encoders. If the driver reads no encoders, the estimate uses the
commands to the motors, which miss slip and collisions. Both estimates drift, so the pose is marked
as estimated.
"""

from __future__ import annotations

import math
from dataclasses import replace

from robot.driver import ACTION_TIMEOUT_S, Pose

Pair = tuple[float, float]
"""One value for the left wheel, and one for the right wheel."""


def along(pose: Pose, turn_rad: float, way_m: float) -> Pose:
    """Return the pose after an arc with this turn and length."""
    middle_rad = pose.heading_rad + turn_rad / 2
    return replace(
        pose,
        x_m=pose.x_m + way_m * math.cos(middle_rad),
        y_m=pose.y_m + way_m * math.sin(middle_rad),
        heading_rad=math.remainder(pose.heading_rad + turn_rad, math.tau),
    )


class DeadReckoning:
    """Estimates the pose of a body with two wheels.

    Args:
        track_m: Distance between the wheels, in metres.
    """

    def __init__(self, track_m: float) -> None:
        self._track_m = track_m
        self._pose = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0, is_estimate=True)
        self._wheels_m: Pair | None = None
        self._speeds_mps = self._told_m = (0.0, 0.0)
        self._told_s = self._rolled_s = 0.0

    def tell(self, speeds_mps: Pair, now_s: float) -> None:
        """Record the speeds that were sent to the wheels. If no other command follows, the wheels
        stop after `ACTION_TIMEOUT_S`."""
        self._roll(now_s)
        self._speeds_mps, self._told_s = speeds_mps, now_s

    def locate(self, wheels_m: Pair | None, now_s: float) -> Pose:
        """Return the pose; `wheels_m` are the distances that the encoders counted, or None."""
        self._roll(now_s)
        before_m, self._wheels_m = self._wheels_m or wheels_m, wheels_m
        (left_m, right_m), self._told_m = self._told_m, (0.0, 0.0)
        if wheels_m is not None and before_m is not None:
            left_m, right_m = wheels_m[0] - before_m[0], wheels_m[1] - before_m[1]
        self._pose = along(self._pose, (right_m - left_m) / self._track_m, (left_m + right_m) / 2)
        return self._pose

    def _roll(self, now_s: float) -> None:
        """Add the distances that the wheels rolled since the last call, at the commanded speeds."""
        until_s = min(now_s, self._told_s + ACTION_TIMEOUT_S)
        seconds = max(until_s - max(self._rolled_s, self._told_s), 0.0)
        left_m, right_m = self._told_m
        left_mps, right_mps = self._speeds_mps
        self._told_m = left_m + left_mps * seconds, right_m + right_mps * seconds
        self._rolled_s = now_s
