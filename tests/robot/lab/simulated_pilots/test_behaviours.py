"""The teachers of other behaviours can do themselves what they teach."""

from __future__ import annotations

import math
import statistics

import pytest

from robot.lab.simulated_pilots.behaviours import Follower, Pusher, WallFollower
from robot.lab.simulated_pilots.situation import Situation, observe
from robot.lab.simulated_pilots.teachers import Teacher
from robot.simulator.simulation import Simulation
from robot.simulator.world import load_world
from robot.types import Action


def drive(world: str, teacher: Teacher, seconds: float, seed: int) -> list[Situation]:
    simulation = Simulation(load_world(world), seed)
    seen = []
    for tick in range(round(seconds * 10)):
        seen.append(observe(simulation, tick, tick / 10))
        simulation.action = teacher.choose(seen[-1])
        simulation.step(0.1)
    return seen


@pytest.mark.parametrize("seed", range(2))
def test_the_wall_follower_goes_round_with_the_wall_at_its_right(seed: int) -> None:
    seen = drive("corridor", WallFollower(), 80.0, seed)
    assert 0.15 < statistics.median(s.range_at_m(-math.pi / 2) for s in seen) < 0.40
    assert not any(s.is_pushing for s in seen)
    assert {s.pose.y_m > 1.2 for s in seen} == {True, False}, "it came to the other side"


@pytest.mark.parametrize("seed", [481, 489])
def test_the_wall_follower_gets_on_among_gaps(seed: int) -> None:
    seen = drive("office", WallFollower(), 60.0, seed)
    # It never alternates between left and right on one spot for 20 s.
    for start in range(0, 400, 50):
        at = [s.pose for s in seen[start : start + 200]]
        assert (
            math.dist(
                (min(p.x_m for p in at), min(p.y_m for p in at)),
                (max(p.x_m for p in at), max(p.y_m for p in at)),
            )
            > 0.15
        )


@pytest.mark.parametrize("seed", range(2))
def test_the_follower_keeps_the_barrel_in_view(seed: int) -> None:
    seen = drive("follow", Follower(), 60.0, seed)
    in_view = [abs(s.target.bearing_rad) < math.radians(31) for s in seen if s.target]
    assert sum(in_view) > 0.95 * len(seen)
    assert max(s.target.distance_m for s in seen if s.target) < 1.0


@pytest.mark.parametrize("seed", range(3))
def test_the_pusher_brings_the_box_to_a_wall(seed: int) -> None:
    seen = drive("push", Pusher(), 30.0, seed)
    gaps = [s.target.wall_gap_m for s in seen if s.target]
    assert gaps[0] > 0.5
    assert min(gaps) < 0.02


def test_each_teacher_tolerates_its_own_moves() -> None:
    for world, teacher in (("corridor", WallFollower()), ("follow", Follower())):
        for situation in drive(world, teacher, 5.0, 0):
            assert teacher.tolerates(situation, teacher.choose(situation))
        assert not teacher.tolerates(situation, Action.STOP)
