"""How the body moves, bumps and hears; the numbers are worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from robot.devices.simulation.body import (
    RADIUS_M,
    WHEELS_MPS,
    _ray_m,
    move,
    push_out,
    ranges_m,
    sonar_m,
)
from robot.devices.simulation.world import Obstacle, World, load_world
from robot.types import Action, Pose


def drive(action: Action, seconds: float, pose: Pose) -> Pose:
    return move(pose, *WHEELS_MPS[action], seconds)


@pytest.fixture
def box() -> World:
    return load_world("box")


MIDDLE = Pose(x_m=0.575, y_m=0.575, heading_rad=0.0)


def test_forward_is_sixteen_centimetres_a_second() -> None:
    assert drive(Action.FORWARD, 2.0, MIDDLE).x_m == pytest.approx(0.575 + 0.32)


@pytest.mark.parametrize(("action", "sign"), [(Action.LEFT, 1), (Action.RIGHT, -1)])
def test_a_turn_is_18_5_degrees_a_second_about_the_standing_wheel(
    action: Action, sign: int
) -> None:
    pose = MIDDLE
    for _ in range(100):
        pose = drive(action, 0.01, pose)
    assert math.degrees(pose.heading_rad) == pytest.approx(sign * 18.5)
    for _ in range(1846):
        pose = drive(action, 0.01, pose)
    assert pose.x_m == pytest.approx(MIDDLE.x_m, abs=1e-3), "a full turn, 19.5 s, comes back"


def test_a_wall_stops_the_body_and_presses_the_bumper(box: World) -> None:
    pose, contacts = push_out(box, Pose(x_m=1.10, y_m=0.5, heading_rad=0.0))
    assert pose.x_m == pytest.approx(1.15 - RADIUS_M)
    assert [c.presses_left and c.presses_right for c in contacts] == [True]


def test_a_wall_at_the_side_presses_only_that_side(box: World) -> None:
    _, contacts = push_out(box, Pose(x_m=0.5, y_m=1.10, heading_rad=math.radians(45)))
    assert contacts[0].presses_left
    assert not contacts[0].presses_right


def test_a_wall_behind_presses_nothing(box: World) -> None:
    _, contacts = push_out(box, Pose(x_m=0.05, y_m=0.5, heading_rad=0.0))
    assert not contacts[0].presses_left
    assert not contacts[0].presses_right


def test_a_corner_pushes_out_of_both_walls(box: World) -> None:
    pose, _ = push_out(box, Pose(x_m=1.2, y_m=1.2, heading_rad=0.8))
    assert pose.x_m == pytest.approx(1.15 - RADIUS_M)
    assert pose.y_m == pytest.approx(1.15 - RADIUS_M)


def test_sonar_hears_the_wall_ahead(box: World) -> None:
    assert sonar_m(box, MIDDLE) == pytest.approx(0.575 - RADIUS_M)


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_sonar_and_body_meet_obstacles(box: World, shape: str) -> None:
    thing = Obstacle(
        name="thing",
        shape=shape,
        x_m=0.95,
        y_m=0.575,
        width_m=0.2,
        depth_m=0.2,
        height_m=0.2,
        heading_rad=0.0,
        colour=(0, 0, 0),
    )
    world = replace(box, obstacles=(thing,))
    assert sonar_m(world, MIDDLE) == pytest.approx(0.85 - 0.575 - RADIUS_M)
    pose, contacts = push_out(world, replace(MIDDLE, x_m=0.80))
    assert pose.x_m == pytest.approx(0.85 - RADIUS_M)
    assert contacts


def test_a_turned_box_is_met_where_it_stands(box: World) -> None:
    plank = Obstacle(
        name="plank",
        shape="box",
        x_m=0.95,
        y_m=0.575,
        width_m=0.4,
        depth_m=0.02,
        height_m=0.2,
        heading_rad=math.pi / 2,
        colour=(0, 0, 0),
    )
    world = replace(box, obstacles=(plank,))
    assert sonar_m(world, MIDDLE) == pytest.approx(0.94 - 0.575 - RADIUS_M)


def test_many_ranges_at_once_are_as_the_sonars_single_rays() -> None:
    world = load_world("office")
    bearings = np.radians(np.arange(0.0, 360.0, 7.0))
    for pose in (Pose(x_m=1.0, y_m=1.0, heading_rad=0.0), Pose(x_m=2.6, y_m=1.9, heading_rad=1.3)):
        single = [_ray_m(world, pose, pose.heading_rad + bearing) for bearing in bearings]
        assert ranges_m(world, pose, bearings) == pytest.approx(np.array(single))
