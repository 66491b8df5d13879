"""Describes in numbers what a pilot sees on the screen.

A person looks at the frame and sees where there is room to drive. A simulated pilot does not look
at the frame, but gets the distances in the simulated world at the time at which the frame was
taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robot.driver import Pose
from robot.simulator.body import RADIUS_M
from robot.simulator.sensors import ranges_m
from robot.simulator.simulation import Simulation
from robot.simulator.things import wall_gap_m
from robot.simulator.world import WALLS, World
from robot.types import Action

FAN_RAD: NDArray[np.float64] = np.radians(np.linspace(-108.0, 108.0, 55))
"""Directions in which the free distance is measured: every 4 degrees, from right to left."""
_AHEAD = len(FAN_RAD) // 2
_MARGIN_M = 0.015
"""Distance that a pilot wants to keep from things, in metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """The thing of interest: its bearing, its distance, and its distance from a wall."""

    bearing_rad: float
    distance_m: float
    wall_gap_m: float


@dataclass(frozen=True, kw_only=True)
class Situation:
    """The situation at one frame.

    `ranges_m` are measured from the body's centre, along `FAN_RAD`.
    """

    frame_id: int
    at_s: float
    pose: Pose
    distance_m: float
    bumped: bool
    is_pushing: bool
    doing: Action
    # excluded from comparison, because `==` of arrays is an array
    ranges_m: NDArray[np.float64] = field(compare=False)
    ahead: str
    """The thing straight ahead of the robot: `east wall`, `backpack` ..."""
    target: Target | None = None
    """The moving or movable thing, if the place has one."""

    @property
    def free_ahead_m(self) -> float:
        """The distance in metres that the body could drive straight ahead."""
        return float(self.free_ways_m[_AHEAD])

    @cached_property
    def free_ways_m(self) -> NDArray[np.float64]:
        """The distances that the body could drive after turning by each of `FAN_RAD`, shape (55,).

        The body is a disc. Any obstacle that is less than the body's radius, plus a margin, beside
        its path blocks the body.
        """
        ways = _ways_m(self.ranges_m, FAN_RAD[None, :] - FAN_RAD[:, None])
        nearest: NDArray[np.float64] = ways.min(axis=1)
        return nearest

    def range_at_m(self, bearing_rad: float) -> float:
        return float(np.interp(bearing_rad, FAN_RAD, self.ranges_m))

    def turn_needed_rad(self, side: int, free_m: float) -> float:
        """Return the angle to turn until the distance `free_m` ahead is free; pi if no visible
        direction is free.

        Args:
            side: 1 for left, -1 for right.
            free_m: The distance that has to be free.
        """
        ways = self.free_ways_m[_AHEAD:] if side > 0 else self.free_ways_m[_AHEAD::-1]
        free = np.flatnonzero(ways > free_m)
        return abs(float(FAN_RAD[_AHEAD + int(free[0])])) if len(free) else math.pi

    def room_m(self, side: int) -> float:
        """Return the mean free distance on one side, up to a limit."""
        half = self.ranges_m[_AHEAD + 4 :] if side > 0 else self.ranges_m[: _AHEAD - 3]
        return float(np.minimum(half, 1.2).mean())


def observe(simulation: Simulation, frame_id: int, at_s: float) -> Situation:
    """Return the robot's current situation."""
    sensors = simulation.sensors.read()
    ranges = ranges_m(simulation.world, simulation.pose, FAN_RAD)
    return Situation(
        frame_id=frame_id,
        at_s=at_s,
        pose=simulation.pose,
        distance_m=sensors.distance_m or 0.0,
        bumped=bool(sensors.bumped),
        is_pushing=simulation.is_pushing,
        doing=simulation.action,
        ranges_m=ranges,
        ahead=_name_of_what_is_ahead(simulation.world, simulation.pose, ranges),
        target=_target(simulation.world, simulation.pose),
    )


def _target(world: World, pose: Pose) -> Target | None:
    for thing in world.obstacles:
        if thing.is_movable or thing.path:
            x_m, y_m = thing.x_m - pose.x_m, thing.y_m - pose.y_m
            return Target(
                bearing_rad=math.remainder(math.atan2(y_m, x_m) - pose.heading_rad, math.tau),
                distance_m=math.hypot(x_m, y_m),
                wall_gap_m=wall_gap_m(thing, world),
            )
    return None


def _ways_m(ranges: NDArray[np.float64], bearings_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """For each point, return the distance that the body can drive straight ahead before it touches
    the point. The distance is infinite if the body would pass the point."""
    aside, ahead = ranges * np.sin(bearings_rad), ranges * np.cos(bearings_rad)
    edge = np.sqrt(np.maximum(RADIUS_M**2 - aside**2, 0.0))
    is_in_the_way = (ahead > 0) & (np.abs(aside) < RADIUS_M + _MARGIN_M)
    return np.where(is_in_the_way, np.maximum(ahead - edge, 0.0), np.inf)


def _name_of_what_is_ahead(world: World, pose: Pose, ranges: NDArray[np.float64]) -> str:
    first = int(_ways_m(ranges, FAN_RAD).argmin())
    angle = pose.heading_rad + float(FAN_RAD[first])
    x_m = pose.x_m + float(ranges[first]) * math.cos(angle)
    y_m = pose.y_m + float(ranges[first]) * math.sin(angle)
    to_walls = dict(zip(WALLS, (y_m, world.width_m - x_m, world.depth_m - y_m, x_m), strict=True))
    wall = min(to_walls, key=lambda name: to_walls[name])
    if to_walls[wall] < 1e-6 or not world.obstacles:
        return f"{wall} wall"
    nearest = min(world.obstacles, key=lambda o: math.hypot(o.x_m - x_m, o.y_m - y_m))
    return nearest.name
