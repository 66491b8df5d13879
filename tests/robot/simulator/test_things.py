"""Moving things: pushed by the robot, or moving along a path."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from robot.simulator.body import RADIUS_M
from robot.simulator.simulation import Simulation
from robot.simulator.things import wall_gap_m
from robot.simulator.world import load_world
from robot.types import Action, Pose


def test_a_movable_box_yields_and_stops_at_the_wall() -> None:
    world = load_world("push")
    square = replace(world.obstacles[0], heading_rad=0.0)
    simulation = Simulation(replace(world, obstacles=(square,)), 0, is_noisy=False)
    simulation.pose = Pose(x_m=0.6, y_m=1.1, heading_rad=0.0)
    simulation.action = Action.FORWARD
    simulation.step(4.0)
    (parcel,) = simulation.world.obstacles
    assert parcel.x_m > 1.2, "it was pushed along"
    assert simulation.pose.x_m + RADIUS_M <= parcel.x_m
    simulation.step(10.0)
    (parcel,) = simulation.world.obstacles
    assert 0.0 <= wall_gap_m(parcel, simulation.world) < 0.02
    assert simulation.is_pushing


def test_a_thing_that_is_not_movable_stays() -> None:
    simulation = Simulation(load_world("office"), 0, is_noisy=False)
    before = simulation.world
    simulation.pose = Pose(x_m=1.3, y_m=1.3, heading_rad=0.0)
    simulation.action = Action.FORWARD
    simulation.step(5.0)
    assert simulation.world is before


def test_a_push_beside_the_middle_turns_the_box() -> None:
    simulation = Simulation(load_world("push"), 0, is_noisy=False)
    simulation.pose = Pose(x_m=0.7, y_m=1.18, heading_rad=0.0)
    heading = simulation.world.obstacles[0].heading_rad
    simulation.action = Action.FORWARD
    simulation.step(3.0)
    # Pushed on its left half, seen from the robot, it turns clockwise.
    assert simulation.world.obstacles[0].heading_rad < heading - math.radians(2)


def test_a_thing_on_its_path_goes_round_and_comes_back() -> None:
    simulation = Simulation(load_world("follow"), 0, is_noisy=False)
    simulation.pose = Pose(x_m=1.6, y_m=1.6, heading_rad=0.0)
    (barrel,) = simulation.world.obstacles
    points = [*barrel.path, barrel.path[0]]
    length_m = sum(math.dist(a, b) for a, b in pairwise(points))
    simulation.step(10.0)
    (moved,) = simulation.world.obstacles
    assert moved.gone_m == pytest.approx(0.5)
    assert (moved.x_m, moved.y_m) == pytest.approx((1.9, 0.7))
    simulation.step(length_m / barrel.speed_mps - 10.0)
    (back,) = simulation.world.obstacles
    assert math.dist((back.x_m, back.y_m), barrel.path[0]) < 0.01


def test_a_thing_waits_for_a_robot_in_its_way() -> None:
    simulation = Simulation(load_world("follow"), 0, is_noisy=False)
    simulation.pose = Pose(x_m=1.65, y_m=0.7, heading_rad=0.0)
    simulation.step(10.0)
    (barrel,) = simulation.world.obstacles
    assert barrel.x_m + barrel.width_m / 2 < 1.65 - RADIUS_M


def test_the_picture_shows_where_a_thing_is_now_and_restart_puts_it_back() -> None:
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")
    simulation = Simulation(load_world("follow"), 0, is_noisy=False)

    def orange() -> float:
        picture = simulation.render().astype(int)
        return float(np.mean((picture[..., 0] > 150) & (picture[..., 2] < 60)))

    simulation.pose = Pose(x_m=0.8, y_m=0.7, heading_rad=0.0)
    near = orange()
    simulation.step(20.0)
    assert 0 < orange() < near / 2, "it has gone away"
    simulation.restart()
    simulation.pose = Pose(x_m=0.8, y_m=0.7, heading_rad=0.0)
    assert orange() == near
    simulation.close()
