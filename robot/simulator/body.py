"""The simulated body: its motion by wheels, its collisions, and its sonar. Pure.

Speeds are the paper's: 16 cm/s forward. In a turn one wheel drives backward at a quarter of this
speed and the other stands still. So the robot turns about the standing wheel, by 18.5 degrees a
second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.devkit.wheels import CLASSIC_POINTS, TwoWheels
from robot.simulator.world import Obstacle, World
from robot.types import Pose

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

SONAR_RANGE_M = 2.55
SONAR_HALF_CONE_RAD = math.radians(12.5)
_SONAR_RAYS_RAD = np.linspace(-SONAR_HALF_CONE_RAD, SONAR_HALF_CONE_RAD, 7)
Overlap = tuple[float, float, float]
"""Overlap of the body with a wall or a thing: the unit normal (x, y) and the depth."""
_LEFT_BUMPER_RAD = math.radians(-10), math.radians(80)
"""Bearings of the left bumper, relative to straight ahead; the right bumper mirrors it."""


def bumpers(contacts_rad: Sequence[float]) -> tuple[bool, bool]:
    """Return whether the left and the right bumper are pressed by contacts at these bearings."""
    least, most = _LEFT_BUMPER_RAD
    return (
        any(least <= at_rad <= most for at_rad in contacts_rad),
        any(least <= -at_rad <= most for at_rad in contacts_rad),
    )


def move(pose: Pose, left_mps: float, right_mps: float, dt_s: float) -> Pose:
    """Return the pose after `dt_s` at these wheel speeds, without walls: an arc of a circle."""
    turn_rad = (right_mps - left_mps) / TRACK_M * dt_s
    return pose.along(turn_rad, (left_mps + right_mps) / 2 * dt_s)


def push_out(world: World, pose: Pose) -> tuple[Pose, list[float]]:
    """Move the body out of all walls and things that it overlaps, so that it slides along their
    sides.

    Returns:
        The pose, and the bearing of each contact relative to straight ahead.
    """
    x_m, y_m = pose.x_m, pose.y_m
    contacts_rad: list[float] = []
    for _ in range(3):  # in a corner the push from one wall may lead into the other wall
        normals = _overlaps(world, x_m, y_m)
        if not normals:
            break
        for normal_x, normal_y, depth_m in normals:
            x_m += normal_x * depth_m
            y_m += normal_y * depth_m
            at_rad = math.atan2(-normal_y, -normal_x) - pose.heading_rad
            contacts_rad.append(math.remainder(at_rad, math.tau))
    return Pose(x_m=x_m, y_m=y_m, heading_rad=pose.heading_rad), contacts_rad


def sonar_m(world: World, pose: Pose) -> float:
    """Return the distance from the body's front edge to the nearest thing in the sonar's cone."""
    nearest_m = min(SONAR_RANGE_M + RADIUS_M, float(ranges_m(world, pose, _SONAR_RAYS_RAD).min()))
    return max(nearest_m - RADIUS_M, 0.0)


def ranges_m(world: World, pose: Pose, bearings_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the free distance from the body's centre at each bearing, relative to straight
    ahead."""
    angles = pose.heading_rad + bearings_rad
    steps_x, steps_y = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):  # rays may be parallel to a wall
        to_x = np.abs(np.where(steps_x > 0, world.width_m - pose.x_m, pose.x_m) / steps_x)
        to_y = np.abs(np.where(steps_y > 0, world.depth_m - pose.y_m, pose.y_m) / steps_y)
    ranges = np.minimum(to_x, to_y)
    for obstacle in world.obstacles:
        ranges = np.minimum(ranges, _ranges_to_m(obstacle, pose, steps_x, steps_y))
    return ranges


def _ranges_to_m(
    obstacle: Obstacle, pose: Pose, steps_x: NDArray[np.float64], steps_y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance to one thing along each ray; infinite if the ray misses it."""
    turn_rad = -obstacle.heading_rad  # transform into the obstacle's coordinates
    from_x, from_y = _turned(turn_rad, pose.x_m - obstacle.x_m, pose.y_m - obstacle.y_m)
    rays_x, rays_y = _turned(turn_rad, steps_x, steps_y)
    if obstacle.shape == "cylinder":
        half = from_x * rays_x + from_y * rays_y
        inside = half * half - (from_x**2 + from_y**2 - (obstacle.width_m / 2) ** 2)
        enter = -half - np.sqrt(np.maximum(inside, 0.0))
        return np.where((inside >= 0) & (enter >= 0), enter, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        sides_x = np.stack((-obstacle.width_m / 2 - from_x, obstacle.width_m / 2 - from_x))
        sides_y = np.stack((-obstacle.depth_m / 2 - from_y, obstacle.depth_m / 2 - from_y))
        x = np.sort(sides_x[:, None] / rays_x, axis=0)
        y = np.sort(sides_y[:, None] / rays_y, axis=0)
    enter = np.fmax(np.fmax(x[0], y[0]), 0.0)
    leave = np.fmin(x[1], y[1])
    return np.where(enter <= leave, enter, np.inf)


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
    along, across = _turned(-heading_rad, x_m - obstacle.x_m, y_m - obstacle.y_m)
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
    normal_x, normal_y = _turned(heading_rad, gap_x / gap_m, gap_y / gap_m)
    return normal_x, normal_y, reach_m - gap_m


def _turned(turn_rad: float, x: Any, y: Any) -> tuple[Any, Any]:
    """Rotate a vector, or an array of vectors."""
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    return x * cos - y * sin, y * cos + x * sin


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
