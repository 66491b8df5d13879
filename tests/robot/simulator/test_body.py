"""The body's motion, collisions and sensors; the numbers were computed by hand."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from robot.simulator.body import RADIUS_M, WHEELS_MPS, move, push_out
from robot.simulator.sensors import bumpers, ranges_m, sonar_m
from robot.simulator.world import Obstacle, World, load_world, world_names
from robot.types import Action, Pose


@pytest.fixture
def box() -> World:
    return load_world("box")


MIDDLE = Pose(x_m=0.575, y_m=0.575, heading_rad=0.0)


def test_forward_is_sixteen_centimetres_a_second() -> None:
    assert move(MIDDLE, *WHEELS_MPS[Action.FORWARD], 2.0).x_m == pytest.approx(0.575 + 0.32)


@pytest.mark.parametrize(("action", "sign"), [(Action.LEFT, 1), (Action.RIGHT, -1)])
def test_a_turn_is_18_5_degrees_a_second_about_the_standing_wheel(
    action: Action, sign: int
) -> None:
    pose = MIDDLE
    for tick in range(1946):
        pose = move(pose, *WHEELS_MPS[action], 0.01)
        if tick == 99:
            assert math.degrees(pose.heading_rad) == pytest.approx(sign * 18.5)
    assert pose.x_m == pytest.approx(MIDDLE.x_m, abs=1e-3), "a full turn, 19.5 s, comes back"


EDGE_M = 1.15 - RADIUS_M
WALLS = {
    "ahead": (Pose(x_m=1.10, y_m=0.5, heading_rad=0.0), (EDGE_M, 0.5), (True, True)),
    "at the left": (Pose(x_m=0.5, y_m=1.10, heading_rad=math.pi / 4), (0.5, EDGE_M), (True, False)),
    "behind": (Pose(x_m=0.05, y_m=0.5, heading_rad=0.0), (RADIUS_M, 0.5), (False, False)),
    "corner": (Pose(x_m=1.2, y_m=1.2, heading_rad=math.pi / 4), (EDGE_M, EDGE_M), (True, True)),
}


@pytest.mark.parametrize(("pose", "pushed_m", "pressed"), WALLS.values(), ids=WALLS)
def test_a_wall_pushes_the_body_out_and_presses_the_bumper_at_its_side(
    box: World, pose: Pose, pushed_m: tuple[float, float], pressed: tuple[bool, bool]
) -> None:
    pose, contacts = push_out(box, pose)
    assert (pose.x_m, pose.y_m) == pytest.approx(pushed_m)
    assert contacts and bumpers(contacts) == pressed


def test_sonar_hears_the_wall_ahead(box: World) -> None:
    assert sonar_m(box, MIDDLE) == pytest.approx(0.575 - RADIUS_M)


@pytest.mark.parametrize(
    ("shape", "width_m", "depth_m", "heading_rad"),
    [("box", 0.2, 0.2, 0.0), ("cylinder", 0.2, 0.2, 0.0), ("box", 0.4, 0.2, math.pi / 2)],
)
def test_sonar_and_body_meet_obstacles_where_they_stand(
    box: World, shape: str, width_m: float, depth_m: float, heading_rad: float
) -> None:
    thing = Obstacle(
        name="thing",
        shape=shape,
        x_m=0.95,
        y_m=0.575,
        width_m=width_m,
        depth_m=depth_m,
        height_m=0.2,
        heading_rad=heading_rad,
        colour=(0, 0, 0),
    )
    world = replace(box, obstacles=(thing,))
    assert sonar_m(world, MIDDLE) == pytest.approx(0.85 - 0.575 - RADIUS_M)
    pose, contacts = push_out(world, replace(MIDDLE, x_m=0.80))
    assert pose.x_m == pytest.approx(0.85 - RADIUS_M)
    assert contacts


def is_free(world: World, x_m: float, y_m: float) -> bool:
    """Return whether a point is in the room and in none of the things."""
    if not (0 <= x_m <= world.width_m and 0 <= y_m <= world.depth_m):
        return False
    for thing in world.obstacles:
        across, along = x_m - thing.x_m, y_m - thing.y_m
        cos, sin = math.cos(thing.heading_rad), math.sin(thing.heading_rad)
        own_x, own_y = across * cos + along * sin, along * cos - across * sin
        is_in_box = abs(own_x) <= thing.width_m / 2 and abs(own_y) <= thing.depth_m / 2
        is_round = thing.shape == "cylinder"
        if math.hypot(own_x, own_y) <= thing.width_m / 2 if is_round else is_in_box:
            return False
    return True


@pytest.mark.parametrize("name", world_names())
def test_each_range_ends_at_the_first_obstacle(name: str) -> None:
    world, dice = load_world(name), random.Random(name)
    bearings = np.radians(np.arange(0.0, 360.0, 7.0))
    for _ in range(20):
        x_m, y_m = dice.uniform(0.0, world.width_m), dice.uniform(0.0, world.depth_m)
        if not is_free(world, x_m, y_m):
            continue
        pose = Pose(x_m=x_m, y_m=y_m, heading_rad=dice.uniform(-math.pi, math.pi))
        for bearing, range_m in zip(bearings, ranges_m(world, pose, bearings), strict=True):
            step_x, step_y = (part(pose.heading_rad + bearing) for part in (math.cos, math.sin))
            for way_m in [*np.arange(0.0, range_m, 0.02), range_m - 1e-9]:
                assert is_free(world, x_m + way_m * step_x, y_m + way_m * step_y)
            beyond_m = range_m + 1e-9
            assert not is_free(world, x_m + beyond_m * step_x, y_m + beyond_m * step_y)
