"""The simulation as a whole: seeds, noise, pictures."""

from __future__ import annotations

import random
import sys
from types import FrameType

import numpy as np
import pytest

from robot.errors import ConfigurationError
from robot.simulator.driver import SimDriver, SimOptions
from robot.simulator.simulation import Simulation
from robot.simulator.world import load_world
from robot.types import Action, Point

pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")


def run(seed: int, steps: int = 30) -> tuple[object, bytes]:
    simulation = Simulation(load_world("office"), seed)
    simulation.action = Action.FORWARD
    for _ in range(steps):
        simulation.step(0.1)
        picture = simulation.render()
    sensed = simulation.sensors.read()
    simulation.close()
    return (sensed.pose, sensed.distance_m), picture.tobytes()


def test_the_same_seed_gives_the_same_numbers_and_pictures() -> None:
    assert run(seed=4) == run(seed=4)
    assert run(seed=4) != run(seed=5)


def test_the_picture_shows_floor_below_and_wall_above() -> None:
    simulation = Simulation(load_world("box"), seed=0, is_noisy=False)
    picture = simulation.render()
    assert picture.shape == (120, 160, 3)
    assert picture[:20].mean() > picture[-20:].mean() + 50
    simulation.close()


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
    assert not simulation.is_pushing, "a turn rolls back"
    simulation.action, simulation.point = Action.FORWARD, None
    assert simulation.sensors.read().bumped
    assert (simulation.sensors.read().distance_m or 0) < 0.1


def test_the_speed_scale_scales_the_distance() -> None:
    ways = []
    for scale in (1.0, 0.5):
        simulation = Simulation(load_world("office"), seed=0, is_noisy=False)
        start = simulation.pose
        simulation.action, simulation.speed_scale = Action.FORWARD, scale
        simulation.step(1.0)
        ways.append(np.hypot(simulation.pose.x_m - start.x_m, simulation.pose.y_m - start.y_m))
    assert ways[0] == pytest.approx(0.16)
    assert ways[1] == pytest.approx(0.08)


def test_the_uncertainty_of_the_path_is_the_same_at_any_frame_rate() -> None:
    spread = []
    for rate_hz in (10, 30, 200):
        headings = []
        for seed in range(150):
            simulation = Simulation(load_world("office"), seed)
            begun = simulation.pose.heading_rad
            simulation.action = Action.FORWARD
            for _ in range(rate_hz):
                simulation.step(1 / rate_hz)
            headings.append(simulation.pose.heading_rad - begun)
        spread.append(float(np.std(headings)))
    assert spread == pytest.approx([spread[0]] * 3, rel=0.25)


def test_a_robot_that_is_carried_about_starts_and_sees_where_it_is_each_time() -> None:
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
    """The page asks during the step: after every line of the step the new place is shown."""
    simulation = Simulation(load_world("box"), seed=0)
    simulation.step(0.1)
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
    assert simulation.world.name == "office"
    assert (set(shown), len(shown) > 10) == ({"office"}, True)
