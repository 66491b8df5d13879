"""The phone as a camera, with a clock that the test moves: its messages when it is gone or
blind."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from robot.bodies.phone.camera import NOBODY, PhoneCamera, PhoneOptions
from robot.devkit.freshness import STILL_S
from robot.devkit.pictures import Picture
from robot.testing import VirtualClock
from robot.types import Encoding


class Clock(VirtualClock):
    """Starts no thread: the test moves time and calls the watch itself."""

    def start_thread(self, target, name: str) -> Any:
        return SimpleNamespace(join=lambda timeout=None: None)


@pytest.fixture
def camera() -> Iterator[PhoneCamera]:
    with PhoneCamera(PhoneOptions(), Clock(100.0)) as running:
        yield running


def look(camera: PhoneCamera, seconds: float) -> None:
    """Let time pass, and have the watch check once at the end."""
    clock = camera.clock
    assert isinstance(clock, Clock)
    clock.advance(seconds)
    waits = iter([False, True])
    clock.wait = lambda event, timeout_s=None: next(waits)
    camera._watch()


def offer(camera: PhoneCamera, data: bytes, ago_s: float = 0.05, **how: bool) -> None:
    picture = Picture(encoding=Encoding.JPEG, width=4, height=3, data=data)
    camera.offer(picture, camera.clock.now_s() - ago_s, **how)


def test_before_the_first_picture_the_camera_says_how_to_connect_a_phone(
    camera: PhoneCamera,
) -> None:
    look(camera, STILL_S + 0.1)
    assert camera.fault == NOBODY and camera.latest() is None
    offer(camera, b"one", 0.08)
    frame = camera.latest()
    assert camera.fault is None and frame is not None
    assert frame.captured_s == pytest.approx(camera.clock.now_s() - 0.08)


def test_stamps_are_never_of_the_future_and_never_go_back(camera: PhoneCamera) -> None:
    stamps = []
    for index, ago_s in enumerate([0.1, -5.0, 3.0, 0.0, 60.0]):
        look(camera, 0.05)
        offer(camera, bytes([index]), ago_s)
        frame = camera.latest()
        assert frame is not None and frame.captured_s <= camera.clock.now_s()
        stamps.append(frame.captured_s)
    assert stamps == sorted(stamps)


@pytest.mark.parametrize(("repeats", "said"), [(False, "no pictures"), (True, "repeats")])
def test_silence_and_a_frozen_picture_are_faults_in_time(
    camera: PhoneCamera, repeats: bool, said: str
) -> None:
    offer(camera, b"one")
    for _ in range(9):
        look(camera, 0.05)
        if repeats:
            offer(camera, b"one")
    assert said in (camera.fault or "")
    offer(camera, b"two")
    assert camera.fault is None


def test_a_covered_lens_is_a_fault_and_its_pictures_are_not_shown(camera: PhoneCamera) -> None:
    offer(camera, b"one")
    offer(camera, b"dark", covered=True)
    assert "covered" in (camera.fault or "")
    frame = camera.latest()
    assert frame is not None and frame.data == b"one"
    offer(camera, b"light")
    assert camera.fault is None


def test_a_phone_that_leaves_is_a_fault_at_once(camera: PhoneCamera) -> None:
    told: list[str | None] = []
    offer(camera, b"one")
    camera.listen(lambda: told.append(camera.fault))
    camera.lose()
    assert "gone" in (camera.fault or "") and told == [camera.fault]


def test_a_stopped_camera_accepts_no_picture(camera: PhoneCamera) -> None:
    camera.stop()
    offer(camera, b"one")
    camera.lose()
    assert camera.latest() is None and camera.fault is None
