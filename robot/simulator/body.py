"""The simulated body: its motion by wheels, and its collisions. Pure.

The speeds are those of the paper: 16 cm/s forward. In a turn one wheel drives backward at 4 cm/s,
and the robot turns about the other wheel, which stands still, at 18.5 degrees a second.
"""

from __future__ import annotations

import math
from typing import Any

from robot.devkit.dead_reckoning import along
from robot.devkit.wheels import CLASSIC_POINTS, TwoWheels
from robot.driver import Pose
from robot.simulator.world import Obstacle, World

FORWARD_MPS = 0.16
TURNING_WHEEL_MPS = 0.04
TRACK_M = TURNING_WHEEL_MPS / math.radians(18.5)
RADIUS_M = 0.09
"""Radius of the body, in metres. In collisions the body is a disc."""

WHEELS = TwoWheels(
    ahead=FORWARD_MPS,
    back=FORWARD_MPS / 2,
    turn=(-TURNING_WHEEL_MPS, 0.0),
    spin=TURNING_WHEEL_MPS,
)
WHEELS_MPS = {move: WHEELS.at(point) for move, point in CLASSIC_POINTS.items()}
"""Speed of the left and the right wheel for each action."""

Overlap = tuple[float, float, float]
"""Overlap of the body with a wall or a thing: the unit normal (x, y) and the depth."""


def move(pose: Pose, left_mps: float, right_mps: float, dt_s: float) -> Pose:
    """Return the pose after `dt_s` at these wheel speeds, without walls: an arc of a circle."""
    turn_rad = (right_mps - left_mps) / TRACK_M * dt_s
    return along(pose, turn_rad, (left_mps + right_mps) / 2 * dt_s)


def push_out(world: World, pose: Pose) -> tuple[Pose, list[float]]:
    """Move the body out of all walls and things that it overlaps, so that it slides along their
    sides.

    Returns:
        The pose, and for each contact its bearing relative to straight ahead, in radians.
    """
    x_m, y_m = pose.x_m, pose.y_m
    contacts_rad: list[float] = []
    for _ in range(3):  # in a corner, the push from one wall may move the body into the other
        normals = _overlaps(world, x_m, y_m)
        if not normals:
            break
        for normal_x, normal_y, depth_m in normals:
            x_m += normal_x * depth_m
            y_m += normal_y * depth_m
            at_rad = math.atan2(-normal_y, -normal_x) - pose.heading_rad
            contacts_rad.append(math.remainder(at_rad, math.tau))
    return Pose(x_m=x_m, y_m=y_m, heading_rad=pose.heading_rad), contacts_rad


def _overlaps(world: World, x_m: float, y_m: float) -> list[Overlap]:
    """List the overlaps of the disc at (x, y)."""
    walls = (
        (1.0, 0.0, RADIUS_M - x_m),
        (-1.0, 0.0, x_m - (world.width_m - RADIUS_M)),
        (0.0, 1.0, RADIUS_M - y_m),
        (0.0, -1.0, y_m - (world.depth_m - RADIUS_M)),
    )
    things = (overlap_with(obstacle, x_m, y_m) for obstacle in world.obstacles)
    return [*(wall for wall in walls if wall[2] > 0.0), *filter(None, things)]


def overlap_with(obstacle: Obstacle, x_m: float, y_m: float) -> Overlap | None:
    """Return the unit normal and depth of the body's overlap with one thing; None if there is no
    overlap."""
    heading_rad = obstacle.heading_rad
    along, across = turned(-heading_rad, x_m - obstacle.x_m, y_m - obstacle.y_m)
    if obstacle.shape == "cylinder":
        near_x = near_y = 0.0
        reach_m = RADIUS_M + obstacle.width_m / 2
    else:
        near_x = _clamp(along, obstacle.width_m / 2)
        near_y = _clamp(across, obstacle.depth_m / 2)
        reach_m = RADIUS_M
    gap_x, gap_y = along - near_x, across - near_y
    gap_m = math.hypot(gap_x, gap_y)
    if gap_m >= reach_m:
        return None
    if gap_m == 0.0:  # the centre is inside: move away from the obstacle's centre
        gap_x, gap_y, gap_m = along or 1.0, across, math.hypot(along or 1.0, across)
        reach_m = gap_m + RADIUS_M
    normal_x, normal_y = turned(heading_rad, gap_x / gap_m, gap_y / gap_m)
    return normal_x, normal_y, reach_m - gap_m


def turned(turn_rad: float, x: Any, y: Any) -> tuple[Any, Any]:
    """Rotate a vector, or an array of vectors."""
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    return x * cos - y * sin, y * cos + x * sin


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
