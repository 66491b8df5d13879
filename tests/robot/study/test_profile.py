"""The published measure, on numbers computed by hand."""

import pytest

from robot.study.profile import THRESHOLDS_M, behavior_profile, compare
from robot.types import Action

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def test_the_thresholds_are_the_papers():
    assert len(THRESHOLDS_M) == 201
    assert [*THRESHOLDS_M[:2], THRESHOLDS_M[-1]] == pytest.approx([0, 0.02, 4.0])


def test_a_profile_is_the_share_of_readings_below_each_threshold():
    profile = behavior_profile([F, F, L, F, F, Action.STOP], [0.03, 0.05, 0.01, 0.05, 9.0, 0.0])
    assert set(profile) == {F, L}
    # Forward was driven at 3, 5, 5 cm and far away: 0, 0, 1, 3 of 4 readings are below 0, 2, 4, 6
    # cm.
    assert profile[F][:4].tolist() == [0, 0, 0.25, 0.75]
    assert profile[F][-1] == 0.75
    assert profile[L][:3].tolist() == [0, 1, 1]
    assert behavior_profile([F], [0.0])[F][:2].tolist() == [0, 1], "at a threshold: not below it"


def test_the_ssd_adds_squares_over_moves_and_thresholds():
    teacher = behavior_profile([F, L, L], [0.03, 0.03, 0.05])
    robot = behavior_profile([F, L], [0.07, 0.03])
    difference = compare(teacher, robot, (F, L))
    # Forward: 1 against 0 at c = 0.04 and 0.06, alike from 0.08 on. Left: 0.5 against 1 at 0.04.
    assert difference.per_move == {F: pytest.approx(2.0), L: pytest.approx(0.25)}
    assert difference.ssd == difference.made == pytest.approx(2.25)
    assert difference.never_by_robot == ()
    assert compare(teacher, teacher, (F, L)).ssd == 0


def test_a_move_never_made_counts_as_nothing_below_any_distance_and_is_named():
    teacher = behavior_profile([F, L], [0.03, 3.95])
    robot = behavior_profile([F], [0.03])
    difference = compare(teacher, robot, (F, L, R))
    # The teacher's only left turn was at 3.95 m: below 3.96, 3.98 and 4.00 m.
    assert difference.ssd == pytest.approx(3.0)
    assert difference.made == 0
    assert difference.never_by_robot == (L, R)
    assert difference.never_by_teacher == (R,)


def test_moves_and_distances_belong_together():
    with pytest.raises(ValueError, match="2 moves"):
        behavior_profile([F, F], [1.0])
