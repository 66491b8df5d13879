"""The simulated body's motion, collisions and sensors have the values computed by hand."""

from __future__ import annotations

import math
import random
import sys
from dataclasses import replace
from itertools import pairwise
from types import FrameType

import numpy as np
import pytest

from robot.driver import Pose
from robot.errors import ConfigurationError
from robot.moves import CLASSIC, Move
from robot.simulator.body import RADIUS_M, WHEELS_MPS, move, push_out
from robot.simulator.driver import SimDriver, SimOptions
from robot.simulator.sensors import bumpers, sonar_m
from robot.simulator.simulation import Simulation
from robot.simulator.things import wall_gap_m
from robot.simulator.world import Obstacle, World, load_world
from robot.types import Action, Point

MIDDLE = Pose(x_m=0.575, y_m=0.575, heading_rad=0.0)
EDGE_M = 1.15 - RADIUS_M


@pytest.mark.parametrize(("action", "sign"), [(Action.LEFT, 1), (Action.RIGHT, -1)])
def test_a_turn_is_18_5_degrees_a_second_about_the_standing_wheel(
    action: Action, sign: int
) -> None:
    pose = MIDDLE
    for tick in range(1946):
        pose = move(pose, *WHEELS_MPS[action], 0.01)
        if tick == 99:
            assert math.degrees(pose.heading_rad) == pytest.approx(sign * 18.5)
    assert pose.x_m == pytest.approx(MIDDLE.x_m, abs=1e-3), "a full turn of 19.5 s"


@pytest.mark.parametrize(
    ("pose", "pushed_m", "pressed"),
    [
        (Pose(x_m=1.10, y_m=0.5, heading_rad=0.0), (EDGE_M, 0.5), (True, True)),
        (Pose(x_m=0.5, y_m=1.10, heading_rad=math.pi / 4), (0.5, EDGE_M), (True, False)),
        (Pose(x_m=0.05, y_m=0.5, heading_rad=0.0), (RADIUS_M, 0.5), (False, False)),
        (Pose(x_m=1.2, y_m=1.2, heading_rad=math.pi / 4), (EDGE_M, EDGE_M), (True, True)),
    ],
    ids=["ahead", "at the left", "behind", "corner"],
)
def test_a_wall_pushes_the_body_out_and_presses_the_bumper_at_its_side(
    pose: Pose, pushed_m: tuple[float, float], pressed: tuple[bool, bool]
) -> None:
    pose, contacts = push_out(load_world("box"), pose)
    assert (pose.x_m, pose.y_m) == pytest.approx(pushed_m)
    assert contacts and bumpers(contacts) == pressed


@pytest.mark.parametrize(
    ("shape", "width_m", "heading_rad"),
    [("box", 0.2, 0.0), ("cylinder", 0.2, 0.0), ("box", 0.4, math.pi / 2)],
)
def test_sonar_and_body_meet_obstacles_at_their_positions(
    shape: str, width_m: float, heading_rad: float
) -> None:
    thing = Obstacle(
        name="thing",
        shape=shape,
        x_m=0.95,
        y_m=0.575,
        width_m=width_m,
        depth_m=0.2,
        height_m=0.2,
        heading_rad=heading_rad,
        colour=(0, 0, 0),
    )
    world = replace(load_world("box"), obstacles=(thing,))
    assert sonar_m(world, MIDDLE) == pytest.approx(0.85 - 0.575 - RADIUS_M)
    pose, contacts = push_out(world, replace(MIDDLE, x_m=0.80))
    assert pose.x_m == pytest.approx(0.85 - RADIUS_M) and contacts


def placed(world: World, x_m: float, y_m: float, *, seconds: float = 0.0) -> Simulation:
    """Return a perfect simulation whose robot has driven ahead from a place for some seconds."""
    simulation = Simulation(world, 0, is_noisy=False)
    simulation.pose = Pose(x_m=x_m, y_m=y_m, heading_rad=0.0)
    simulation.action = Action.FORWARD if seconds else Action.STOP
    simulation.step(seconds)
    return simulation


@pytest.mark.parametrize(
    ("action", "point"),
    [(Action.FORWARD, None), (Action.FORWARD, Point(0.0, 0.5)), (Action.LEFT, Point(-0.2, 0.5))],
)
def test_the_robot_pushes_a_wall_when_it_drives_against_it(
    action: Action, point: Point | None
) -> None:
    simulation = Simulation(load_world("box"), seed=0)
    simulation.action, simulation.point = action, point
    pushed = False
    for _ in range(120):
        simulation.step(0.1)
        pushed = pushed or simulation.is_pushing
    assert pushed
    simulation.action, simulation.point = Action.LEFT, None
    assert not simulation.is_pushing, "a robot that turns does not push"
    assert simulation.sensors.read().bumped
    assert (simulation.sensors.read().distance_m or 0) < 0.1


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_forward_is_sixteen_centimetres_a_second_at_full_speed(scale: float) -> None:
    simulation = placed(load_world("office"), 1.0, 0.5)
    simulation.action, simulation.speed_scale = Action.FORWARD, scale
    simulation.step(1.0)
    assert simulation.pose.x_m - 1.0 == pytest.approx(0.16 * scale)


def test_the_uncertainty_of_the_path_is_the_same_at_any_frame_rate() -> None:
    spread = []
    for rate_hz in (10, 200):
        headings = []
        for seed in range(150):
            simulation = Simulation(load_world("office"), seed)
            begun = simulation.pose.heading_rad
            simulation.action = Action.FORWARD
            for _ in range(rate_hz):
                simulation.step(1 / rate_hz)
            headings.append(simulation.pose.heading_rad - begun)
        spread.append(float(np.std(headings)))
    assert spread[0] == pytest.approx(spread[1], rel=0.25)


def test_a_movable_box_yields_and_stops_at_the_wall() -> None:
    world = load_world("push")
    square = replace(world.obstacles[0], heading_rad=0.0)
    simulation = placed(replace(world, obstacles=(square,)), 0.6, 1.1, seconds=4.0)
    (parcel,) = simulation.world.obstacles
    assert parcel.x_m > 1.2, "the robot pushed the parcel along"
    assert simulation.pose.x_m + RADIUS_M <= parcel.x_m
    simulation.step(10.0)
    (parcel,) = simulation.world.obstacles
    assert 0.0 <= wall_gap_m(parcel, simulation.world) < 0.02
    assert simulation.is_pushing


def test_a_push_beside_the_middle_turns_the_box() -> None:
    world = load_world("push")
    simulation = placed(world, 0.7, 1.18, seconds=3.0)
    # The robot pushes the left half of the object, which therefore turns clockwise.
    assert simulation.world.obstacles[0].heading_rad < world.obstacles[0].heading_rad - 0.03


def test_an_object_that_is_not_movable_stays() -> None:
    world = load_world("office")
    assert placed(world, 1.3, 1.3, seconds=5.0).world is world


def test_a_moving_object_follows_its_path_and_waits_for_a_robot_in_its_way() -> None:
    simulation = placed(load_world("follow"), 1.6, 1.6)
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
    simulation.restart()
    assert simulation.world.obstacles == (barrel,)
    simulation.pose = Pose(x_m=1.65, y_m=0.7, heading_rad=0.0)
    simulation.step(10.0)
    (barrel,) = simulation.world.obstacles
    assert barrel.x_m + barrel.width_m / 2 < 1.65 - RADIUS_M


def test_a_robot_that_is_carried_about_starts_and_sees_where_it_is_each_time() -> None:
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")
    dice = random.Random(7)
    driver = SimDriver(SimOptions(world="box", seed=3))
    driver.connect()
    simulation = driver.simulation
    for name in dice.choices(sorted(driver.worlds), k=24):
        driver.send_action(dice.choice(list(driver.moves)))
        driver.enter(name)
        driver.advance(dice.choice([0.001, 0.03, 1.0]))
        assert simulation.world.name == name
        simulation.is_noisy = False
        there = Simulation(load_world(name), 3, is_noisy=False)
        there.world, there.pose = simulation.world, simulation.pose
        assert (simulation.render() == there.render()).all()
        there.close()
    simulation.close()
    with pytest.raises(ConfigurationError, match="choose one of: box, clutter"):
        driver.enter("nowhere")


def test_another_thread_never_sees_the_place_that_the_robot_has_left() -> None:
    """The page asks for the pose after each line of a step, and always gets the new pose."""
    simulation = Simulation(load_world("box"), seed=0)
    simulation.first_world = load_world("office")
    shown = [simulation.shown_world.name]

    def look(frame: FrameType, event: str, _: object) -> object:
        if frame.f_code.co_filename == Simulation.step.__code__.co_filename:
            sys.settrace(None)
            shown.append(simulation.shown_world.name)
            sys.settrace(look)
        return look

    sys.settrace(look)
    simulation.step(0.1)
    sys.settrace(None)
    assert (set(shown), len(shown) > 10) == ({"office"}, True)


def test_a_declared_move_without_wheel_speeds_is_refused_with_the_remedy() -> None:
    class Gripper(SimDriver):
        declared_moves = (*CLASSIC.values(), Move(Action("grip")))

    with Gripper(SimOptions()) as driver:
        driver.send_action(Action.FORWARD)
        with pytest.raises(ConfigurationError, match=r"'grip'; add .* to robot\.simulator\.body"):
            driver.send_action(Action("grip"))
        driver.advance(0.1)
        assert driver.simulation.action is Action.FORWARD
