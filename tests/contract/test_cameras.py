"""What every camera must do, wherever its pictures come from."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from robot.camera import Camera
from robot.policy.image import to_grey, to_rgb
from robot.rig.options import options_of
from robot.rig.plugins import camera_names, load_camera
from robot.types import Frame
from tests.contract.builders import CAMERAS, CameraCase

DEADLINE_S = 10.0


@pytest.fixture(params=camera_names())
def case(request: pytest.FixtureRequest) -> Iterator[CameraCase]:
    assert request.param in CAMERAS, f"say in builders.py how to build {request.param!r}"
    with CAMERAS[request.param]() as built:
        yield built
        built.camera.stop()


def take(camera: Camera, count: int) -> list[Frame]:
    """Wait for `count` different frames; the newest each time the camera calls."""
    frames: list[Frame] = []
    enough = threading.Event()

    def note() -> None:
        frame = camera.latest()
        if frame is not None and len(frames) < count:
            frames.append(frame)
        if len(frames) >= count:
            enough.set()

    camera.listen(note)
    assert enough.wait(DEADLINE_S), f"{len(frames)} of {count} frames came; {camera.fault}"
    camera.listen(None)
    return frames


def test_it_declares_what_it_is(case: CameraCase) -> None:
    kind = type(case.camera)
    assert load_camera(kind.name) is kind
    assert all(option.help for option in options_of(kind.options_type))


def test_nothing_before_start_and_stop_is_always_safe(case: CameraCase) -> None:
    case.camera.stop()
    assert case.camera.latest() is None
    case.camera.stop()


def test_frames_count_up_and_are_stamped_by_the_clock(case: CameraCase) -> None:
    before_s = case.camera.clock.now_s()
    with case.camera as camera:
        frames = take(camera, 4)
        after_s = camera.clock.now_s()
    ids = [frame.frame_id for frame in frames]
    stamps = [frame.captured_s for frame in frames]
    assert ids == sorted(set(ids))
    assert stamps == sorted(stamps)
    assert before_s - 1.0 <= stamps[0] <= stamps[-1] <= after_s


def test_a_frame_is_a_picture_of_its_size(case: CameraCase) -> None:
    with case.camera as camera:
        frame = take(camera, 1)[0]
    assert to_rgb(frame).shape == (frame.height, frame.width, 3)
    assert to_grey(frame).shape == (frame.height, frame.width)


def test_it_starts_again_after_a_stop_and_ids_go_on(case: CameraCase) -> None:
    with case.camera as camera:
        first = take(camera, 1)[0]
    with case.camera as camera:
        second = take(camera, 1)[0]
    assert second.frame_id > first.frame_id


def test_it_leaves_no_thread_behind(case: CameraCase) -> None:
    before = set(threading.enumerate())
    with case.camera as camera:
        take(camera, 1)
    assert set(threading.enumerate()) == before
