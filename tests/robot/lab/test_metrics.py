"""The measures of a drive, on drives short enough to count by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from robot.lab import metrics
from robot.lab.metrics import RARE_SHARE, STUCK_S, DriveLog, DriveSample
from robot.types import Action, DrivenBy, Pose

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def along(places, dt_s=0.1):
    return DriveLog(
        [
            DriveSample(
                now_s=7 + i * dt_s,
                action=F,
                driven_by=DrivenBy.ROBOT,
                distance_m=1.0,
                pose=Pose(x_m=x_m, y_m=y_m, heading_rad=0.0),
            )
            for i, (x_m, y_m) in enumerate(places)
        ]
    )


def drive(**columns):
    """Build a drive of 0.5 s ticks, 10 cm each, with flags written as in `is_touching="..x"`."""
    length = len(next(iter(columns.values())))
    moments = along([(0.05 + 0.1 * i, 0.05) for i in range(length)], 0.5)
    for name, marks in columns.items():
        moments = [
            replace(m, **{name: mark == "x"}) for m, mark in zip(moments, marks, strict=True)
        ]
    return DriveLog(moments)


def test_a_drive_and_its_end_last_as_long_as_their_ticks():
    log = drive(is_touching="......")
    assert log.seconds == pytest.approx(3.0)
    assert [m.now_s for m in log.last(1.0)] == [9.0, 9.5]


def test_a_touch_that_lasts_is_one_collision():
    # Two in 3 s are forty a minute.
    assert metrics.collisions_per_minute(drive(is_touching="x.xx..")) == pytest.approx(40)


def test_times_of_pushing_and_of_asking_are_measured():
    log = drive(is_pushing=".xx.x.")
    assert metrics.pushing_s_per_minute(log) == pytest.approx(60 * 1.5 / 3)
    assert metrics.longest_push_s(log) == pytest.approx(1.0)
    assert metrics.longest_push_s(drive(is_pushing="..xx")) == pytest.approx(1.0)
    assert metrics.asking_share(drive(asks_pilot="xxx...")) == pytest.approx(0.5)


def test_distance_and_covered_floor_are_measured():
    log = drive(is_touching="....")
    assert metrics.driven_m(log) == pytest.approx(0.3)
    assert metrics.covered_m2(log) == pytest.approx(4 * 0.01)
    there_and_back = DriveLog([*log, *log[::-1]])
    assert metrics.covered_m2(there_and_back) == pytest.approx(4 * 0.01)


def test_agreement_counts_ticks_with_both():
    log = drive(is_touching="....")
    both = zip(log, [L, F, F, None], [L, F, L, L], strict=True)
    log = DriveLog([replace(m, proposed=proposed, wanted=wanted) for m, proposed, wanted in both])
    assert metrics.agreement(log) == pytest.approx(2 / 3)
    assert metrics.agreement(drive(is_touching="..")) is None


def test_an_empty_drive_has_no_figures():
    log = DriveLog()
    assert metrics.collisions_per_minute(log) == metrics.pushing_s_per_minute(log) == 0
    assert metrics.asking_share(log) == log.seconds == metrics.longest_stay_s(log) == 0
    assert len(log.last(5)) == 0


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
    log = along(places)
    assert metrics.longest_stay_s(log) == pytest.approx(brute_force_s(log))


def test_turning_on_one_spot_is_stuck_and_driving_is_not():
    circle = [(0.06 * math.cos(i / 30), 0.06 * math.sin(i / 30)) for i in range(300)]
    assert metrics.is_stuck(along(circle))
    assert not metrics.is_stuck(along(circle[: round(STUCK_S / 0.1) - 5]))
    assert not metrics.is_stuck(along([(0.016 * i, 0.0) for i in range(300)]))


def test_a_move_is_rare_only_if_neither_makes_it_often():
    teacher = metrics.move_shares([F] * 96 + [R] * 2 + [L] * 2 + [Action.STOP] * 50)
    assert teacher[F] == pytest.approx(0.96)
    robot = metrics.move_shares([F] * 80 + [L] * 20)
    assert metrics.rare_moves(teacher, robot) == {R}
    assert teacher[L] < RARE_SHARE < robot[L]
