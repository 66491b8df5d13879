"""The time of pictures that another clock stamped."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from robot.devkit.threaded_camera import ThreadedCamera
from robot.testing import VirtualClock


class BenchCamera(ThreadedCamera):
    name = "bench"

    def _begin(self) -> None:
        """Take no pictures."""


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> VirtualClock:
    """The machine's own clock, by which kernel drivers stamp their pictures."""
    clock = VirtualClock(50.0)
    monkeypatch.setattr("robot.devkit.threaded_camera.time", SimpleNamespace(monotonic=clock.now_s))
    return clock


def test_a_delay_of_the_camera_makes_no_picture_seem_younger(machine: VirtualClock) -> None:
    class Slow(VirtualClock):
        """The thread is held up right after each reading."""

        def now_s(self) -> float:
            read_s = machine.now_s()
            machine.advance(0.003)
            return read_s

    taken_s = machine.now_s()
    assert BenchCamera(None, Slow())._on_clock(taken_s) <= taken_s


def test_a_time_on_another_clock_keeps_its_age(machine: VirtualClock) -> None:
    taken_s = machine.now_s() - 0.25
    ahead = VirtualClock(machine.now_s() + 3600.0)
    assert BenchCamera(None, ahead)._on_clock(taken_s) == pytest.approx(taken_s + 3600.0)
