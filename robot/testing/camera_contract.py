"""The contract of all cameras: a test suite to inherit, with a fixture `camera_case`."""

from __future__ import annotations

import threading

import pytest

from robot.camera import Camera
from robot.devices.options import options_of
from robot.devices.plugins import load_camera
from robot.errors import ConfigurationError
from robot.policy.image import to_grey, to_rgb
from robot.testing.cases import CameraCase
from robot.types import Frame

DEADLINE_S = 10.0
FROZEN_S = 3.0
"""Time for which a source is frozen, in seconds: longer than any camera waits for its source."""


def take(camera: Camera, count: int) -> list[Frame]:
    """Collect `count` frames: the camera's newest frame each time the camera announces one."""
    frames: list[Frame] = []
    enough = threading.Event()

    def note() -> None:
        frame = camera.latest()
        if frame is not None and len(frames) < count:
            frames.append(frame)
        if len(frames) >= count:
            enough.set()

    camera.listen(note)
    assert camera.clock.wait(enough, DEADLINE_S), (
        f"{len(frames)} of {count} frames arrived; the camera's fault: {camera.fault}"
    )
    camera.listen(None)
    return frames


def wait_for_fault(camera: Camera) -> None:
    """Wait until the camera reports a fault."""
    told = threading.Event()
    camera.listen(lambda: told.set() if camera.fault else None)
    assert camera.fault or camera.clock.wait(told, DEADLINE_S), (
        "the source froze, but the camera reports no fault"
    )
    camera.listen(None)


class CameraContract:
    """The tests that every camera must pass. Each test gets a case whose camera is not started."""

    def test_it_declares_what_it_is(self, camera_case: CameraCase) -> None:
        kind = type(camera_case.camera)
        assert load_camera(kind.name) is kind
        assert all(option.help for option in options_of(kind.options_type))

    def test_nothing_before_start_and_stop_is_always_safe(self, camera_case: CameraCase) -> None:
        camera_case.camera.stop()
        assert camera_case.camera.latest() is None
        camera_case.camera.stop()

    def test_frames_count_up_and_are_stamped_by_the_clock(self, camera_case: CameraCase) -> None:
        before_s = camera_case.camera.clock.now_s()
        with camera_case.camera as camera:
            frames = take(camera, 4)
            after_s = camera.clock.now_s()
        ids = [frame.frame_id for frame in frames]
        stamps = [frame.captured_s for frame in frames]
        assert ids == sorted(set(ids))
        assert stamps == sorted(stamps)
        assert before_s - 1.0 <= stamps[0] <= stamps[-1] <= after_s

    def test_a_frame_is_a_picture_of_its_size(self, camera_case: CameraCase) -> None:
        with camera_case.camera as camera:
            frame = take(camera, 1)[0]
        assert to_rgb(frame).shape == (frame.height, frame.width, 3)
        assert to_grey(frame).shape == (frame.height, frame.width)

    def test_it_can_be_mounted_on_its_side(self, camera_case: CameraCase) -> None:
        """A camera that is mounted on its side turns all its pictures; a camera of recorded
        pictures refuses this. Skipped if the extension that corrects cameras is not installed."""
        corrections = pytest.importorskip("robot.adjustments.corrections")
        camera, on_its_side = camera_case.camera, corrections.CameraCorrection(turn_deg=90)
        if not camera.can_be_turned:
            with pytest.raises(ConfigurationError, match=camera.name):
                corrections.check_mounting(camera, on_its_side)
            return
        with camera:
            plain = take(camera, 1)[0]
            camera.mounting = on_its_side
            turned = take(camera, 2)[-1]
        assert (turned.width, turned.height) == (plain.height, plain.width)
        assert to_rgb(turned).shape == (turned.height, turned.width, 3)

    def test_it_starts_again_after_a_stop_and_ids_go_on(self, camera_case: CameraCase) -> None:
        """After a restart, the camera does not reuse the ids of earlier frames."""
        with camera_case.camera as camera:
            first = take(camera, 1)[0]
        with camera_case.camera as camera:
            second = take(camera, 1)[0]
        assert second.frame_id > first.frame_id

    def test_it_leaves_no_thread_behind(self, camera_case: CameraCase) -> None:
        before = set(threading.enumerate())
        with camera_case.camera as camera:
            take(camera, 1)
        assert set(threading.enumerate()) == before

    def test_a_frozen_source_is_a_fault(self, camera_case: CameraCase) -> None:
        """The camera reports a frozen source, and does not pass on its last picture as a new
        one."""
        if camera_case.freeze is None:
            pytest.skip("this source cannot be frozen: the case has no freeze")
        with camera_case.camera as camera:
            take(camera, 2)
            camera_case.freeze()
            wait_for_fault(camera)

    def test_a_source_that_was_frozen_is_seen_again(self, camera_case: CameraCase) -> None:
        """The camera delivers pictures again after its source was frozen for some time, even if the
        connection to the source was closed meanwhile."""
        if camera_case.freeze is None or camera_case.thaw is None:
            pytest.skip("this source cannot be frozen and thawed: the case has no thaw")
        with camera_case.camera as camera:
            take(camera, 2)
            camera_case.freeze()
            wait_for_fault(camera)
            camera.clock.wait(threading.Event(), FROZEN_S)
            camera_case.thaw()
            take(camera, 2)


class TestCamera(CameraContract):
    """The suite that `pytest --drivelesson-camera NAME` runs on an installed camera."""
