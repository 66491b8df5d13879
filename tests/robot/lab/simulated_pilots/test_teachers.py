"""The moves that simulated teachers want, in constructed situations."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from robot.lab.simulated_pilots.situation import FAN_RAD, Situation, observe
from robot.lab.simulated_pilots.teachers import (
    TEACHER_PARAMS,
    SonarController,
    Steerer,
    TeacherParams,
    Wanderer,
)
from robot.simulator.body import RADIUS_M
from robot.simulator.simulation import Simulation
from robot.simulator.world import load_world
from robot.types import Action, Pose

from .test_behaviours import drive

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def situation(
    *,
    at_s: float = 0.0,
    distance_m: float = 1.0,
    bumped: bool = False,
    wall_m: float = 9.0,
    slant_rad: float = 0.0,
    doing: Action = F,
    x_m: float = 0.0,
) -> Situation:
    """A straight wall `wall_m` ahead of the body's edge, turned by `slant_rad` from square."""
    to_wall = (wall_m + RADIUS_M) * math.cos(slant_rad)
    towards = np.cos(FAN_RAD - slant_rad)
    return Situation(
        frame_id=1,
        at_s=at_s,
        pose=Pose(x_m=x_m, y_m=0.0, heading_rad=0.0),
        distance_m=distance_m,
        bumped=bumped,
        is_pushing=False,
        doing=doing,
        ranges_m=np.where(towards > 1e-3, to_wall / np.maximum(towards, 1e-3), 99.0),
        ahead="wall",
    )


def test_the_teacher_sees_the_true_distances() -> None:
    simulation = Simulation(load_world("box"), 0, is_noisy=False)
    simulation.pose = Pose(x_m=0.5, y_m=0.575, heading_rad=0.0)
    seen = observe(simulation, 3, 1.5)
    assert seen.free_ahead_m == pytest.approx(0.65 - RADIUS_M)
    assert seen.ahead == "east wall"
    assert seen.distance_m == pytest.approx(0.65 - RADIUS_M)
    assert seen.turn_needed_rad(1, 0.1) == 0.0
    assert seen.turn_needed_rad(1, 5.0) == math.pi


def test_a_proportional_teacher_steers_more_near_an_obstacle() -> None:
    teacher, steered = Steerer((L, R)), []
    for tick in range(40):
        wall_m = 0.8 - 0.02 * tick
        move = teacher.choose(situation(at_s=tick / 10, wall_m=wall_m, slant_rad=-0.5))
        assert teacher.point is not None
        steered.append(teacher.point.steering)
        assert move is (L if steered[-1] < -0.2 else F)
    assert steered[0] == 0.0 and steered[-1] < -0.9
    assert all(0.0 <= before - now < 0.25 for before, now in itertools.pairwise(steered))
    assert not teacher.tolerates(replace(situation(at_s=5.0, doing=L), is_pushing=True), L)


def test_a_slanted_wall_is_left_on_its_far_side() -> None:
    # The wall is nearer on the left, so a right turn frees the way sooner.
    near_left = situation(wall_m=0.2, slant_rad=math.radians(30))
    assert near_left.turn_needed_rad(-1, 0.4) < near_left.turn_needed_rad(1, 0.4)
    assert Wanderer((L, R)).choose(near_left) is R
    assert Wanderer((L, R)).choose(situation(wall_m=0.2, slant_rad=math.radians(-30))) is L
    assert Wanderer((L,)).choose(near_left) is L


def test_a_turn_once_begun_goes_on_until_the_way_is_free() -> None:
    teacher = Wanderer((L, R), TeacherParams(turn_at_m=0.2, go_at_m=0.5))
    ways = [1.0, 0.19, 0.3, 0.49, 0.51, 0.3]
    assert [teacher.choose(situation(wall_m=m)) for m in ways[:1]] == [F]
    turns = [teacher.choose(situation(wall_m=m)) for m in ways[1:4]]
    assert len(set(turns)) == 1
    assert turns[0] in (L, R)
    assert [teacher.choose(situation(wall_m=m)) for m in ways[4:]] == [F, F]


def test_a_habit_goes_before_the_shorter_turn() -> None:
    near_left = situation(wall_m=0.2, slant_rad=math.radians(30))
    assert Wanderer((L, R), TeacherParams(left_at=("wall",))).choose(near_left) is L
    assert Wanderer((L, R), TeacherParams(right_at=("door",))).choose(near_left) is R


def test_in_a_narrow_place_less_is_enough_after_a_long_turn() -> None:
    teacher = Wanderer((L,), TeacherParams(turn_at_m=0.2, go_at_m=0.9))
    assert teacher.choose(situation(wall_m=0.1, at_s=0.0)) is L
    assert teacher.choose(situation(wall_m=0.4, at_s=7.9)) is L
    assert teacher.choose(situation(wall_m=0.4, at_s=8.1)) is F


def test_the_teacher_tolerates_moves_that_do_no_harm() -> None:
    teacher = Wanderer((L, R), TeacherParams(turn_at_m=0.2, go_at_m=0.5, danger_m=0.06))
    assert teacher.tolerates(situation(wall_m=1.0), F)
    assert not teacher.tolerates(situation(wall_m=0.05), F)
    assert not teacher.tolerates(situation(wall_m=1.0), L), "it turns where there is room"
    assert teacher.tolerates(situation(wall_m=0.5), L)
    assert not teacher.tolerates(situation(wall_m=1.0), Action.STOP)


def test_staying_in_one_place_is_not_tolerated_for_long() -> None:
    teacher = Wanderer((L, R))
    assert teacher.tolerates(situation(wall_m=0.5, at_s=0.0), L)
    assert teacher.tolerates(situation(wall_m=0.5, at_s=12.9), L)
    assert not teacher.tolerates(situation(wall_m=0.5, at_s=13.1), L)
    assert teacher.tolerates(situation(wall_m=0.5, at_s=13.2, x_m=0.2), L), "it moved"


@pytest.mark.parametrize("seed", range(3))
def test_the_wide_teacher_crosses_most_of_what_a_robot_can_cross(seed: int) -> None:
    seen = drive("office", Wanderer(params=TEACHER_PARAMS["wide"]), 240.0, seed)
    squares = [(moment.pose.x_m // 0.1, moment.pose.y_m // 0.1) for moment in seen]
    crossed = [len(set(squares[start : start + 600])) for start in range(0, 2400, 600)]
    assert np.mean(crossed) >= 80  # squares of 10 cm


def test_the_papers_controller_turns_left_for_two_seconds() -> None:
    controller = SonarController()

    def at(at_s: float, distance_m: float, bumped: bool = False) -> Action:
        return controller.choose(situation(at_s=at_s, distance_m=distance_m, bumped=bumped))

    assert at(0.0, 0.20) is F, "20 cm is not below 20 cm"
    assert at(0.1, 0.19) is L
    assert at(2.0, 1.0) is L
    assert at(2.1, 1.0) is F
    assert at(2.2, 1.0, bumped=True) is L
    assert at(4.2, 0.1) is L, "still near after two seconds: two more"
    assert at(6.1, 1.0) is L
    assert at(6.2, 1.0) is F
