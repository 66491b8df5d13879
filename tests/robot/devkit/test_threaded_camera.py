"""Cameras with threads: the time and the bytes of their pictures, and the errors of their code."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from robot.devkit.pictures import Picture
from robot.devkit.threaded_camera import ThreadedCamera, WatchedCamera
from robot.errors import CameraError
from robot.testing import VirtualClock
from robot.types import Encoding


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


@pytest.mark.parametrize("data", [bytearray(12), np.zeros(12, np.uint8)], ids=["bytes", "array"])
def test_a_frame_does_not_change_when_the_camera_reuses_its_memory(data: Any) -> None:
    """Libraries fill one array again and again, and OpenCV returns a JPEG as an array."""
    camera = BenchCamera(None, VirtualClock())
    picture = Picture(encoding=Encoding.RGB, width=2, height=2, data=data)
    camera._show_picture(picture, 0.0)
    data[0] = 255
    frame = camera.latest()
    assert frame is not None
    assert type(frame.data) is bytes and frame.data == bytes(12)


def test_a_camera_may_report_an_error_as_its_fault() -> None:
    camera, told = BenchCamera(None, VirtualClock()), list[str | None]()
    camera.listen(lambda: told.append(camera.fault))
    for _ in range(2):
        camera._report_fault(OSError("unplugged"))  # type: ignore[arg-type]
    assert told == ["unplugged"]


@pytest.mark.parametrize("base", [ThreadedCamera, WatchedCamera])
@pytest.mark.parametrize("error", [CameraError("The cable is out."), KeyError("exposure")], ids=str)
def test_an_error_of_a_cameras_thread_becomes_its_fault(base: Any, error: Exception) -> None:
    class Broken(base):  # type: ignore[misc]
        name = "broken"

        def _begin(self) -> None:
            (self._watch_over if base is WatchedCamera else self._work)(self._read)

        def _name_fault(self, wrong: str) -> str:
            return wrong

        def _read(self) -> None:
            self.clock.wait(self._ending, 0.2)
            raise error

    clock = VirtualClock()
    with Broken(None, clock) as camera:
        clock.sleep(5.0)
        assert str(error) in camera.fault
        assert ("'broken' failed" in camera.fault) is isinstance(error, KeyError)
    camera.fault = None
    with camera:
        clock.sleep(0.1)
    assert camera.fault is None, "stopping a camera is no fault"
