"""What all cameras have in common."""

from __future__ import annotations

import time

import pytest

from robot.clock import RealClock
from tests.robot.bench_robot import BenchCamera


class _SlowClock(RealClock):
    """The thread is held up right after each reading."""

    def now_s(self) -> float:
        read_s = super().now_s()
        while time.monotonic() < read_s + 0.003:
            pass
        return read_s


def test_a_camera_that_is_held_up_makes_no_picture_younger() -> None:
    taken_s = time.monotonic()
    assert BenchCamera(_SlowClock())._on_clock(taken_s) <= taken_s


def test_a_moment_on_another_clock_keeps_its_age() -> None:
    class Ahead(RealClock):
        def now_s(self) -> float:
            return super().now_s() + 3600.0

    taken_s = time.monotonic() - 0.25
    assert BenchCamera(Ahead())._on_clock(taken_s) == pytest.approx(taken_s + 3600.0, abs=0.05)
