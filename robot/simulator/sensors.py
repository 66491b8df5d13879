"""The simulated body's sensors: the distances to walls and things, and the bumpers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot.driver import Pose, Sensors
from robot.simulator.body import RADIUS_M, turned
from robot.simulator.world import Obstacle, World

SONAR_RANGE_M = 2.55
SONAR_HALF_CONE_RAD = math.radians(12.5)
_SONAR_NOISE_M = 0.005
"""Standard deviation of the sonar's noise, in metres."""
_SONAR_RAYS_RAD = np.linspace(-SONAR_HALF_CONE_RAD, SONAR_HALF_CONE_RAD, 7)
_LEFT_BUMPER_RAD = math.radians(-10), math.radians(80)
"""Bearings that the left bumper covers, relative to straight ahead; the right bumper is its mirror
image."""


class Sensed(Protocol):
    """The robot whose sensors are simulated (`Simulation`)."""

    world: World
    pose: Pose
    contacts_rad: list[float]
    is_noisy: bool


class SimSensors:
    """Reads the sensors of a simulated robot; `seed` determines the sonar's noise."""

    def __init__(self, robot: Sensed, seed: int) -> None:
        self._robot = robot
        self._rng = np.random.default_rng((seed, 1))
        self._measured: tuple[World | None, Pose | None, float] = None, None, 0.0

    def read(self) -> Sensors:
        """Return the readings: sonar with noise, bumpers, and the true pose."""
        world, pose = self._robot.world, self._robot.pose
        noise_m = float(self._rng.normal(0.0, _SONAR_NOISE_M)) if self._robot.is_noisy else 0.0
        measured_in, measured_at, free_m = self._measured
        # Measure again only if the robot has moved or the world has changed.
        if measured_in is not world or measured_at != pose:
            free_m = sonar_m(world, pose)
            self._measured = world, pose, free_m
        pressed = bumpers(self._robot.contacts_rad)
        return Sensors(
            distance_m=max(0.0, free_m + noise_m),
            bumped=any(pressed),
            bumpers=pressed,
            pose=pose,
        )


def bumpers(contacts_rad: Sequence[float]) -> tuple[bool, bool]:
    """Return whether the left and the right bumper are pressed by contacts at these bearings."""
    least, most = _LEFT_BUMPER_RAD
    return (
        any(least <= at_rad <= most for at_rad in contacts_rad),
        any(least <= -at_rad <= most for at_rad in contacts_rad),
    )


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
    from_x, from_y = turned(turn_rad, pose.x_m - obstacle.x_m, pose.y_m - obstacle.y_m)
    rays_x, rays_y = turned(turn_rad, steps_x, steps_y)
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
