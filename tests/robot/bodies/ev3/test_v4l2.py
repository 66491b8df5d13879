"""The Linux camera: its ioctl code runs in another process, and its parts in virtual time."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.v4l2 import device as v4l2
from robot.bodies.v4l2 import reader
from robot.bodies.v4l2.shrink import plan_shrinking, shrink_yuyv
from robot.devkit import usb_camera
from robot.devkit.freshness import LONGEST_PERIOD_S, REOPEN_S, STILL_S, Freshness
from robot.devkit.usb_camera import UsbCamera
from tests.kit.needed import ROOT
from tests.kit.run import run
from tests.robot.bodies.ev3.fake_video import DEVICE, FakeVideo


@pytest.mark.realtime
def test_the_reader_of_linux_cameras_works_and_keeps_the_contract(tmp_path: Path) -> None:
    words = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k")
    own = Path(__file__).with_name("v4l2_with_a_camera.py")
    suite = ("v4l2 and not frozen", "tests/contract/test_cameras.py", own)
    done = run(*words, *suite, env=FakeVideo(tmp_path).env, cwd=ROOT)
    assert done.returncode == 0, done.stdout[-3000:]
    assert "passed" in done.stdout and "skipped" not in done.stdout


def test_freshness_tells_silence_from_repetition() -> None:
    freshness = Freshness(10.0)
    assert freshness.is_new(b"a", 10.1)
    assert not freshness.is_new(b"a", 10.1 + STILL_S)
    assert freshness.fault(10.09 + STILL_S) is None
    assert freshness.fault(10.12 + STILL_S) == "repeats one picture"
    assert freshness.fault(10.12 + 2 * STILL_S + LONGEST_PERIOD_S) == "gives no pictures"
    assert freshness.is_new(b"b", 11.1)
    assert freshness.fault(11.2) is None


@given(st.lists(st.floats(0.02, 0.2), min_size=3, max_size=40))
def test_a_slow_camera_is_not_taken_for_a_silent_one(gaps: list[float]) -> None:
    freshness, now_s = Freshness(0.0), 0.0
    for index, gap in enumerate(gaps):
        now_s += gap
        assert freshness.is_new(b"%d" % index, now_s)
        assert freshness.fault(now_s + gap) is None
    assert freshness.fault(now_s + STILL_S) is None
    assert freshness.fault(now_s + 0.5 + max(gaps)) == "gives no pictures"


class BreakableVideo:
    """A camera of 30 pictures a second on the test's clock, until it breaks or is unplugged."""

    how, now_s = "run", 100.0
    width, height, encoding = 160, 120, "yuyv"
    plugged: ClassVar[dict[str, UsbCamera]] = {}

    def __init__(self, path: str, *wanted: object) -> None:
        if self.how == "gone":
            raise v4l2.CaptureError("there is none")
        self.path, self.camera = path, self.plugged.get(path)
        self._shown_s = 0.0
        self._last = b""

    def read(self) -> v4l2.VideoFrame | None:
        if self.how == "gone" or (self.camera and self.camera not in self.plugged.values()):
            raise OSError(19, "No such device")
        if self.how == "freeze" or self.now_s - self._shown_s < 1 / 30:
            return None
        self._shown_s = self.now_s
        self._last = self._last if self.how == "repeat" else b"%f" % self.now_s
        return v4l2.VideoFrame(self._last, self.now_s)

    def close(self) -> None:
        """There is nothing to close."""


@pytest.fixture
def video(monkeypatch: pytest.MonkeyPatch) -> type[BreakableVideo]:
    plugged: dict[str, UsbCamera] = {}
    for name, value in {"how": "run", "now_s": 100.0, "plugged": plugged}.items():
        monkeypatch.setattr(BreakableVideo, name, value)
    monkeypatch.setattr(reader, "Video", BreakableVideo)
    monkeypatch.setattr(usb_camera, "list_usb_cameras", lambda root=None: [*plugged.values()])
    return BreakableVideo


@pytest.mark.parametrize("how", ["freeze", "repeat", "gone"])
def test_a_broken_camera_is_noticed_within_500_ms_and_picked_up_again(
    video: type[BreakableVideo], how: str
) -> None:
    camera = reader.CameraReader(DEVICE, 160, 120, 30, "auto")

    def until(is_so: Callable[[], bool]) -> float:
        start_s = video.now_s
        while not is_so():
            video.now_s += 0.005
            camera.poll(video.now_s)
            assert video.now_s - start_s < 5.0, "the condition did not hold within 5 s"
        return video.now_s - start_s

    until(lambda: video.now_s > 101.0)
    assert camera.fault is None
    video.how = how
    assert until(lambda: camera.fault is not None) <= 0.5
    assert DEVICE in (camera.fault or "")
    video.how = "run"
    assert until(lambda: camera.fault is None) <= REOPEN_S + 0.1


@pytest.mark.parametrize("serial", ["its own", "the same"])
def test_a_camera_that_was_unplugged_is_not_replaced_by_its_twin(
    video: type[BreakableVideo], serial: str
) -> None:
    """tests/robot/devkit/test_cameras.py tests the identity of cameras."""

    def plug(number: int, serial: str) -> None:
        path = f"/dev/video{number}"
        video.plugged[path] = UsbCamera(path, "C270", "046d 0825", serial, f"1-{number}", "1.0 0")

    def path_after_a_while() -> str:
        for _ in range(100):
            video.now_s += 0.1
            camera.poll(video.now_s)
        return camera.video.path if camera.video else ""

    plug(0, "the same")
    plug(5, "a third")
    camera = reader.CameraReader("auto", 160, 120, 30, "auto")
    assert path_after_a_while() == "" and "2 cameras are plugged in" in str(camera.fault)
    del video.plugged["/dev/video5"]
    assert path_after_a_while() == "/dev/video0"
    plug(2, serial)
    del video.plugged["/dev/video0"]
    assert path_after_a_while() == ""
    plug(0, "the same")
    assert path_after_a_while() == "/dev/video0"


@given(
    st.integers(1, 400).map(lambda n: 2 * n),
    st.integers(1, 600),
    st.integers(0, 64),
    st.sampled_from([(160, 120), (80, 60), (40, 30)]),
)
def test_shrinking_takes_pixels_that_were_there(
    width: int, height: int, padding: int, wanted: tuple[int, int]
) -> None:
    plan = plan_shrinking(width, height, *wanted)
    assert (plan.width <= wanted[0], plan.height <= wanted[1]) == (True, True)
    if width >= wanted[0] and height >= wanted[1]:
        assert (plan.width, plan.height) == wanted
    else:
        assert plan.step == 1
    rng = np.random.default_rng(width * 1000 + height)
    picture = rng.integers(0, 256, (height, width + padding, 2), np.uint8)
    data = shrink_yuyv(picture.tobytes(), 2 * (width + padding), plan)
    small = np.frombuffer(data, np.uint8).reshape(plan.height, plan.width, 2)
    rows = plan.top + plan.step * np.arange(plan.height)
    columns = plan.left + plan.step * np.arange(plan.width)
    assert np.array_equal(small[..., 0], picture[rows][:, columns, 0])
    # The colours of a pair of pixels: U under the first, V under the second.
    pairs = columns[::2] // 2 * 2
    assert np.array_equal(small[:, ::2, 1], picture[rows][:, pairs, 1])
    assert np.array_equal(small[:, 1::2, 1], picture[rows][:, pairs + 1, 1])
