"""The measures of a drive, on short drives whose values can be counted by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from robot.driver import Pose
from robot.lab import metrics
from robot.lab.metrics import RARE_SHARE, STUCK_S, DriveLog, DriveSample
from robot.types import Action, DrivenBy

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


def drive(flag, marks):
    """Build a drive of 0.5 s ticks, 10 cm each; `x` marks the ticks at which the flag is set."""
    moments = along([(0.05 + 0.1 * i, 0.05) for i in range(len(marks))], 0.5)
    set_or_not = zip(moments, marks, strict=True)
    return DriveLog([replace(moment, **{flag: mark == "x"}) for moment, mark in set_or_not])


MEASURES = {
    "a touch that lasts is one collision": ("collisions_per_minute", "is_touching", "x.xx..", 40),
    "pushing": ("pushing_s_per_minute", "is_pushing", ".xx.x.", 30),
    "the longest push": ("longest_push_s", "is_pushing", ".xx.x.", 1.0),
    "a push until the end": ("longest_push_s", "is_pushing", "..xx", 1.0),
    "asking": ("asking_share", "asks_pilot", "xxx...", 0.5),
    "metres": ("driven_m", "is_touching", "....", 0.3),
    "floor": ("covered_m2", "is_touching", "....", 4 * 0.01),
}


@pytest.mark.parametrize(("measure", "flag", "marks", "wanted"), MEASURES.values(), ids=MEASURES)
def test_a_short_drive_has_the_figures_that_are_counted_by_hand(measure, flag, marks, wanted):
    assert getattr(metrics, measure)(drive(flag, marks)) == pytest.approx(wanted)


def test_a_drive_and_its_end_last_as_long_as_their_ticks():
    log = drive("is_touching", "......")
    assert log.seconds == pytest.approx(3.0)
    assert [m.now_s for m in log.last(1.0)] == [9.0, 9.5]
    there_and_back = DriveLog([*log, *log[::-1]])
    assert metrics.covered_m2(there_and_back) == pytest.approx(metrics.covered_m2(log))


def test_agreement_counts_ticks_with_a_move_of_pilot_and_robot():
    log = drive("is_touching", "....")
    both = zip(log, [L, F, F, None], [L, F, L, L], strict=True)
    log = DriveLog([replace(m, proposed=proposed, wanted=wanted) for m, proposed, wanted in both])
    assert metrics.agreement(log) == pytest.approx(2 / 3)
    assert metrics.agreement(drive("is_touching", "..")) is None


def test_an_empty_drive_has_no_figures():
    log = DriveLog()
    assert metrics.collisions_per_minute(log) == metrics.pushing_s_per_minute(log) == 0
    assert metrics.asking_share(log) == log.seconds == metrics.longest_stay_s(log) == 0
    assert len(log.last(5)) == 0


def test_turning_on_one_spot_is_stuck_and_driving_is_not():
    circle = [(0.06 * math.cos(i / 30), 0.06 * math.sin(i / 30)) for i in range(300)]
    assert metrics.is_stuck(along(circle))
    both = along([*[(0.016 * i, 0.0) for i in range(-300, 0)], *circle[:250]])
    assert metrics.longest_stay_s(both) == pytest.approx(25.3, abs=0.5), "the drive counts, too"
    assert not metrics.is_stuck(along(circle[: round(STUCK_S / 0.1) - 5]))
    assert not metrics.is_stuck(along([(0.016 * i, 0.0) for i in range(300)]))


def test_a_move_is_rare_only_if_neither_makes_it_often():
    teacher = metrics.move_shares([F] * 96 + [R] * 2 + [L] * 2 + [Action.STOP] * 50)
    assert teacher[F] == pytest.approx(0.96)
    robot = metrics.move_shares([F] * 80 + [L] * 20)
    assert metrics.rare_moves(teacher, robot) == {R}
    assert teacher[L] < RARE_SHARE < robot[L]


def test_steering_that_changes_more_counts_as_rougher():
    times = np.arange(11) / 10
    assert metrics.steering_per_s(np.linspace(0.0, 1.0, 11), times) == pytest.approx(1.0)
    assert metrics.steering_per_s([0.0] * 5 + [1.0] * 6, times) == pytest.approx(np.sqrt(10.0))
    assert metrics.steering_per_s([0.3], [0.0]) == 0.0
