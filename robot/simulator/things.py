"""The motion of things in a world: on a path, or pushed by the robot. Pure."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

from robot.driver import Pose
from robot.simulator.body import RADIUS_M, overlap_with
from robot.simulator.world import Obstacle, World

_PERSONAL_SPACE_M = 0.03
"""A thing on a path waits while the robot is nearer than this, in metres."""


def move_things(world: World, robot: Pose, dt_s: float) -> World:
    """Return the world after `dt_s`, with the robot at `robot`."""
    if not any(thing.is_movable or thing.path for thing in world.obstacles):
        return world
    moved = tuple(
        _move_along(thing, robot, dt_s) if thing.path else _yield_to(thing, world, robot)
        for thing in world.obstacles
    )
    return replace(world, obstacles=moved)


def _move_along(thing: Obstacle, robot: Pose, dt_s: float) -> Obstacle:
    """Move the thing along its closed path, unless the robot is in the way."""
    gone_m = thing.gone_m + thing.speed_mps * dt_s
    x_m, y_m = _along(thing.path, gone_m)
    before_m = math.hypot(robot.x_m - thing.x_m, robot.y_m - thing.y_m)
    after_m = math.hypot(robot.x_m - x_m, robot.y_m - y_m)
    if after_m < before_m and after_m < thing.width_m / 2 + RADIUS_M + _PERSONAL_SPACE_M:
        return thing
    return replace(thing, x_m=x_m, y_m=y_m, gone_m=gone_m)


def _along(path: tuple[tuple[float, float], ...], way_m: float) -> tuple[float, float]:
    """Return the point after `way_m` along a closed path."""
    legs = list(pairwise([*path, path[0]]))
    lengths_m = [math.dist(a, b) for a, b in legs]
    left_m = way_m % sum(lengths_m)
    for (a, b), length_m in zip(legs, lengths_m, strict=True):
        if left_m <= length_m:
            share = left_m / length_m
            return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share
        left_m -= length_m
    return path[0]


def _yield_to(thing: Obstacle, world: World, robot: Pose) -> Obstacle:
    """Slide and turn the thing away from a pushing robot, as far as walls and other things
    allow."""
    overlap = overlap_with(thing, robot.x_m, robot.y_m) if thing.is_movable else None
    if overlap is None:
        return thing
    normal_x, normal_y, depth_m = overlap
    pushed = replace(thing, x_m=thing.x_m - normal_x * depth_m, y_m=thing.y_m - normal_y * depth_m)
    # A push acts at the point of contact, so a push beside the thing's centre also turns the thing.
    arm_x = robot.x_m - normal_x * RADIUS_M - thing.x_m
    arm_y = robot.y_m - normal_y * RADIUS_M - thing.y_m
    reach_m = math.hypot(thing.width_m, thing.depth_m) / 2
    turn_rad = (arm_y * normal_x - arm_x * normal_y) * depth_m / reach_m**2
    turned = replace(pushed, heading_rad=thing.heading_rad + turn_rad)
    return next((new for new in (turned, pushed) if _fits(new, world)), thing)


def _fits(thing: Obstacle, world: World) -> bool:
    return wall_gap_m(thing, world) >= 0.0 and all(
        math.hypot(other.x_m - thing.x_m, other.y_m - thing.y_m)
        >= (other.width_m + thing.width_m) / 2
        for other in world.obstacles
        if other.name != thing.name
    )


def wall_gap_m(thing: Obstacle, world: World) -> float:
    """Return the distance between a thing and the nearest wall; negative if they overlap."""
    if thing.shape == "cylinder":
        half_x = half_y = thing.width_m / 2
    else:
        cos, sin = abs(math.cos(thing.heading_rad)), abs(math.sin(thing.heading_rad))
        half_x = (thing.width_m * cos + thing.depth_m * sin) / 2
        half_y = (thing.width_m * sin + thing.depth_m * cos) / 2
    return min(
        thing.x_m - half_x,
        world.width_m - thing.x_m - half_x,
        thing.y_m - half_y,
        world.depth_m - thing.y_m - half_y,
    )
