"""The moves of simulated teachers, in constructed situations and in their worlds."""

import math
import statistics

import numpy as np
import pytest

from robot.driver import Pose
from robot.lab.simulated_pilots.behaviours import Follower, Pusher, WallFollower
from robot.lab.simulated_pilots.situation import FAN_RAD, Situation, observe
from robot.lab.simulated_pilots.teachers import (
    SonarController,
    Teacher,
    TeacherParams,
    Wanderer,
)
from robot.simulator.body import RADIUS_M
from robot.simulator.simulation import Simulation
from robot.simulator.world import load_world
from robot.types import Action

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def situation(
    *,
    at_s: float = 0.0,
    distance_m: float = 1.0,
    bumped: bool = False,
    wall_m: float = 9.0,
    slant_deg: float = 0.0,
    doing: Action = F,
    x_m: float = 0.0,
) -> Situation:
    """A straight wall, `wall_m` ahead of the body's edge, slanted by `slant_deg`."""
    slant_rad = math.radians(slant_deg)
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


def drive(world: str, teacher: Teacher, seconds: float, seed: int) -> list[Situation]:
    simulation = Simulation(load_world(world), seed)
    seen = []
    for tick in range(round(seconds * 10)):
        seen.append(observe(simulation, tick, tick / 10))
        simulation.action = teacher.choose(seen[-1])
        simulation.step(0.1)
    return seen


NEAR_LEFT, NEAR_RIGHT = (situation(wall_m=0.2, slant_deg=side) for side in (30, -30))
TURNS = {
    "the wall is nearer on the left": (Wanderer((L, R)), NEAR_LEFT, R),
    "the wall is nearer on the right": (Wanderer((L, R)), NEAR_RIGHT, L),
    "it knows one turn": (Wanderer((L,)), NEAR_LEFT, L),
    "a habit": (Wanderer((L, R), TeacherParams(left_at=("wall",))), NEAR_LEFT, L),
    "a habit elsewhere": (Wanderer((L, R), TeacherParams(right_at=("door",))), NEAR_LEFT, R),
}


@pytest.mark.parametrize(("teacher", "seen", "wanted"), TURNS.values(), ids=TURNS)
def test_a_wall_is_left_on_its_far_side_unless_a_habit_says_otherwise(teacher, seen, wanted):
    assert NEAR_LEFT.turn_needed_rad(-1, 0.4) < NEAR_LEFT.turn_needed_rad(1, 0.4)
    assert teacher.choose(seen) is wanted


def test_a_turn_once_begun_goes_on_until_the_way_is_free_or_it_took_long():
    teacher = Wanderer((L, R), TeacherParams(turn_at_m=0.2, go_at_m=0.5))
    moves = [teacher.choose(situation(wall_m=m)) for m in (1.0, 0.19, 0.3, 0.49, 0.51, 0.3)]
    turn = moves[1]
    assert turn in (L, R) and moves == [F, turn, turn, turn, F, F]
    teacher = Wanderer((L,), TeacherParams(turn_at_m=0.2, go_at_m=0.9))
    ways = ((0.1, 0.0), (0.4, 7.9), (0.4, 8.1))
    assert [teacher.choose(situation(wall_m=m, at_s=at_s)) for m, at_s in ways] == [L, L, F]


def test_the_teacher_tolerates_harmless_moves_but_no_long_stay():
    teacher = Wanderer((L, R), TeacherParams(turn_at_m=0.2, go_at_m=0.5, danger_m=0.06))
    assert teacher.tolerates(situation(wall_m=1.0), F)
    assert not teacher.tolerates(situation(wall_m=0.05), F)
    assert not teacher.tolerates(situation(wall_m=1.0), L), "turning without a wall is wrong"
    assert not teacher.tolerates(situation(wall_m=1.0), Action.STOP)
    teacher = Wanderer((L, R))
    assert teacher.tolerates(situation(wall_m=0.5, at_s=0.0), L)
    assert teacher.tolerates(situation(wall_m=0.5, at_s=12.9), L)
    assert not teacher.tolerates(situation(wall_m=0.5, at_s=13.1), L)
    assert teacher.tolerates(situation(wall_m=0.5, at_s=13.2, x_m=0.2), L), "the robot has moved"


def test_the_papers_controller_turns_left_for_two_seconds():
    controller = SonarController()
    for at_s, distance_m, bumped, wanted in (
        (0.0, 0.20, False, F),  # 20 cm do not count as below 20 cm
        (0.1, 0.19, False, L),
        (2.0, 1.0, False, L),
        (2.1, 1.0, False, F),
        (2.2, 1.0, True, L),
        (4.2, 0.1, False, L),  # the obstacle is still near after two seconds, so turn for two more
        (6.1, 1.0, False, L),
        (6.2, 1.0, False, F),
    ):
        seen = situation(at_s=at_s, distance_m=distance_m, bumped=bumped)
        assert controller.choose(seen) is wanted, at_s


def test_the_wall_follower_goes_round_and_gets_on_among_gaps():
    seen = drive("corridor", WallFollower(), 80.0, seed=1)
    assert 0.15 < statistics.median(s.range_at_m(-math.pi / 2) for s in seen) < 0.40
    assert not any(s.is_pushing for s in seen)
    assert {s.pose.y_m > 1.2 for s in seen} == {True, False}, "the robot has reached the other side"
    at = np.array([(s.pose.x_m, s.pose.y_m) for s in drive("office", WallFollower(), 60.0, 481)])
    for start in range(0, 400, 50):
        reach_m = np.ptp(at[start : start + 200], axis=0)
        assert math.hypot(*reach_m) > 0.15, "the robot alternates between left and right for 20 s"


def test_the_follower_keeps_the_barrel_in_view_and_the_pusher_brings_the_box_to_a_wall():
    targets = [s.target for s in drive("follow", Follower(), 60.0, seed=1)]
    in_view = [abs(t.bearing_rad) < math.radians(31) for t in targets if t]
    assert sum(in_view) > 0.95 * len(targets)
    assert max(t.distance_m for t in targets if t) < 1.0
    gaps = [s.target.wall_gap_m for s in drive("push", Pusher(), 30.0, seed=1) if s.target]
    assert gaps[0] > 0.5 and min(gaps) < 0.02
