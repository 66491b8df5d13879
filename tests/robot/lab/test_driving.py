"""The measures of a drive, on drives short enough to count by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot.lab import metrics
from robot.lab.metrics import DriveLog, DriveSample
from robot.types import Action, DrivenBy, Pose


def drive(**columns: str) -> DriveLog:
    """Build a drive of 0.5 s ticks, 10 cm each, with flags written as in `is_touching="..x"`."""
    length = len(next(iter(columns.values())))
    moments = [
        DriveSample(
            now_s=7 + 0.5 * i,
            action=Action.FORWARD,
            driven_by=DrivenBy.ROBOT,
            distance_m=1.0,
            pose=Pose(x_m=0.05 + 0.1 * i, y_m=0.05, heading_rad=0.0),
        )
        for i in range(length)
    ]
    for name, marks in columns.items():
        moments = [
            replace(m, **{name: mark == "x"}) for m, mark in zip(moments, marks, strict=True)
        ]
    return DriveLog(moments)


def test_the_last_tick_lasts_as_long_as_the_others() -> None:
    assert drive(is_touching="....").seconds == pytest.approx(2.0)


def test_a_touch_that_lasts_is_one_collision() -> None:
    # Two in 3 s are forty a minute.
    assert metrics.collisions_per_minute(drive(is_touching="x.xx..")) == pytest.approx(40)


def test_pushing() -> None:
    log = drive(is_pushing=".xx.x.")
    assert metrics.pushing_s_per_minute(log) == pytest.approx(60 * 1.5 / 3)
    assert metrics.longest_push_s(log) == pytest.approx(1.0)
    assert metrics.longest_push_s(drive(is_pushing="..xx")) == pytest.approx(1.0)


def test_way_and_floor() -> None:
    log = drive(is_touching="....")
    assert metrics.driven_m(log) == pytest.approx(0.3)
    assert metrics.covered_m2(log) == pytest.approx(4 * 0.01)
    there_and_back = DriveLog([*log, *log[::-1]])
    assert metrics.covered_m2(there_and_back) == pytest.approx(4 * 0.01)


def test_asking() -> None:
    assert metrics.asking_share(drive(asks_pilot="xxx...")) == pytest.approx(0.5)


def test_agreement_counts_ticks_with_both() -> None:
    log = drive(is_touching="....")
    proposed = [Action.LEFT, Action.FORWARD, Action.FORWARD, None]
    wanted = [Action.LEFT, Action.FORWARD, Action.LEFT, Action.LEFT]
    log = DriveLog(
        [replace(m, proposed=p, wanted=w) for m, p, w in zip(log, proposed, wanted, strict=True)]
    )
    assert metrics.agreement(log) == pytest.approx(2 / 3)
    assert metrics.agreement(drive(is_touching="..")) is None


def test_parts_of_a_drive() -> None:
    log = drive(is_touching="......")
    assert [m.now_s for m in log.last(1.0)] == [9.0, 9.5]


def test_an_empty_drive_has_no_figures() -> None:
    log = DriveLog()
    assert metrics.collisions_per_minute(log) == metrics.pushing_s_per_minute(log) == 0
    assert metrics.asking_share(log) == log.seconds == 0
    assert len(log.last(5)) == 0
