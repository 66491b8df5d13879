from __future__ import annotations

import math

import pytest

from robot.lab.metrics import (
    RARE_SHARE,
    STUCK_S,
    DriveLog,
    DriveSample,
    is_stuck,
    longest_stay_s,
    move_shares,
    rare_moves,
)
from robot.types import Action, DrivenBy, Pose

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def drive(places, dt_s=0.1):
    return DriveLog(
        [
            DriveSample(
                now_s=i * dt_s,
                action=F,
                driven_by=DrivenBy.ROBOT,
                distance_m=1.0,
                pose=Pose(x_m=x_m, y_m=y_m, heading_rad=0.0),
            )
            for i, (x_m, y_m) in enumerate(places)
        ]
    )


def brute_force_s(log):
    longest_s = 0.0
    for i, first in enumerate(log):
        xs, ys = [], []
        for moment in log[i:]:
            xs.append(moment.pose.x_m)
            ys.append(moment.pose.y_m)
            if max(xs) - min(xs) > 0.15 or max(ys) - min(ys) > 0.15:
                break
            longest_s = max(longest_s, moment.now_s - first.now_s)
    return longest_s


@pytest.mark.parametrize("seed", range(8))
def test_the_longest_stay_is_that_of_trying_all_windows(seed):
    x_m, y_m, places = 0.0, 0.0, []
    for i in range(300):
        step_m = 0.016 if (i // (20 + 5 * seed)) % 2 else 0.001
        x_m += step_m * math.cos(i * 0.07 * seed)
        y_m += step_m * math.sin(i * 0.05 * seed)
        places.append((x_m, y_m))
    log = drive(places)
    assert longest_stay_s(log) == pytest.approx(brute_force_s(log))


def test_turning_on_one_spot_is_stuck_and_driving_is_not():
    circle = [(0.06 * math.cos(i / 30), 0.06 * math.sin(i / 30)) for i in range(300)]
    assert is_stuck(drive(circle))
    assert not is_stuck(drive(circle[: round(STUCK_S / 0.1) - 5]))
    assert not is_stuck(drive([(0.016 * i, 0.0) for i in range(300)]))
    assert longest_stay_s(DriveLog()) == 0.0


def test_a_move_is_rare_only_if_neither_makes_it_often():
    teacher = move_shares([F] * 96 + [R] * 2 + [L] * 2 + [Action.STOP] * 50)
    assert teacher[F] == pytest.approx(0.96)
    robot = move_shares([F] * 80 + [L] * 20)
    assert rare_moves(teacher, robot) == {R}
    assert teacher[L] < RARE_SHARE < robot[L]
