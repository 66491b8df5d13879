"""The real ioctl code with a simulated camera (a preload library that answers for the kernel)."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

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
from tests.kit.run import run
from tests.kit.sizes import few
from tests.robot.bodies.ev3.fake_video import C270_ON_EV3, DEVICE, QUICK, CameraTraits, FakeVideo

ROOT = Path(__file__).parents[4]
NUMBERS = (
    "QUERYCAP ENUM_FMT S_FMT REQBUFS QUERYBUF QBUF DQBUF STREAMON STREAMOFF S_PARM ENUM_FRAMESIZES"
)


class Probe:
    """The camera in a separate process."""

    def __init__(
        self, video: FakeVideo, encoding: str = "auto", device: str = DEVICE, hide: str = ""
    ) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.robot.bodies.ev3.camera_probe", device, encoding, hide],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=video.env,
            cwd=ROOT,
        )

    def next(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        said: dict[str, Any] = json.loads(self.process.stdout.readline())
        return said

    def wait_for(self, is_so: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        for _ in range(200):
            said = self.next()
            if is_so(said):
                return said
        raise AssertionError("waited in vain")

    def end(self) -> None:
        self.process.communicate("\n", timeout=60)


@pytest.fixture
def video(tmp_path: Path) -> FakeVideo:
    return FakeVideo(tmp_path, QUICK)


@pytest.fixture
def probe(video: FakeVideo) -> Iterator[Probe]:
    running = Probe(video)
    yield running
    running.end()


@pytest.mark.realtime
def test_yuyv_comes_as_it_is_and_a_broken_camera_is_noticed_and_picked_up_again(
    video: FakeVideo, probe: Probe
) -> None:
    """One process is used for all of this, because its start takes longer than the rest."""
    said = probe.wait_for(lambda said: said.get("frame") == 3)
    assert said["size"] == [160, 120, 160 * 120 * 2]
    assert said["encoding"] == "yuyv"
    first, second = bytes.fromhex(said["first"]), bytes.fromhex(said["second_row"])
    assert first[1::2] == second[1::2] == b"\x80\x80\x80"
    assert list(second[::2]) == [value + 1 for value in first[::2]]

    said = probe.wait_for(lambda said: said.get("frame", 0) >= 5 and said["age_s"] < 0.1)
    assert said["age_s"] >= 0.00499, "the made-up camera takes its pictures 5 ms before"

    for how, words in (
        ("freeze", "gives no pictures"),
        ("repeat", "repeats one picture"),
        ("gone", "unplugged"),
    ):
        video.behave(how)
        said = probe.wait_for(lambda said: said["fault"] is not None)
        assert words in said["fault"]
        assert DEVICE in said["fault"]
        video.behave("run")
        again = probe.wait_for(lambda said: said["fault"] is None)
        assert again["frame"] > said["frame"]


@pytest.mark.parametrize("format_name", few(["MJPG", "JPEG"], 1))
def test_a_jpeg_is_passed_on_unchanged(tmp_path: Path, format_name: str) -> None:
    running = Probe(FakeVideo(tmp_path, replace(QUICK, format=format_name)))
    said = running.wait_for(lambda said: "frame" in said)
    running.end()
    assert said["encoding"] == "jpeg"
    assert said["first"].startswith("ffd8ff")


def test_a_c270_on_an_ev3_is_read_as_it_is(tmp_path: Path) -> None:
    running = Probe(FakeVideo(tmp_path))
    running.wait_for(lambda said: said.get("frame", 0) >= 3)
    said = [running.next() for _ in range(10)]
    running.end()
    for one in said:
        assert one["fault"] is None
        assert one["age_s"] >= C270_ON_EV3.age_ms / 1000 - 1e-3
        assert one["size"] == [160, 120, 160 * 120 * 2]


@pytest.mark.parametrize(
    ("sizes", "size"),
    few(
        [
            ("320x240", [160, 120]),  # every second pixel
            ("640x480,800x600", [160, 120]),
            ("176x144", [160, 120]),  # the middle
            ("320x176", [160, 120]),
            ("352x288", [160, 120]),
            ("128x96", [128, 96]),  # small as it is
        ],
        3,
    ),
)
def test_pictures_of_other_sizes_are_shrunk(tmp_path: Path, sizes: str, size: list[int]) -> None:
    running = Probe(FakeVideo(tmp_path, replace(QUICK, sizes=sizes)))
    said = running.wait_for(lambda said: "frame" in said)
    running.end()
    assert said["size"] == [*size, size[0] * size[1] * 2]
    first, second = bytes.fromhex(said["first"]), bytes.fromhex(said["second_row"])
    assert first[1::2] == second[1::2] == b"\x80\x80\x80", "colours stay colours"


def test_a_camera_with_only_mjpeg_is_refused_without_a_decoder(tmp_path: Path) -> None:
    video = FakeVideo(tmp_path, replace(QUICK, format="MJPG"))
    running = Probe(video, hide="cv2")
    said = running.next()["error"]
    assert said.startswith(f"the camera {DEVICE} gives only MJPEG, which this computer cannot read")
    assert "camera with YUYV" in said and "drivelesson brick agent ADDRESS" in said
    running.end()


def test_what_a_camera_offers_is_described(tmp_path: Path) -> None:
    traits = CameraTraits(format="YUYV,MJPG", sizes="160x120,320x240")
    code = f"from robot.bodies.v4l2.device import *; print(describe_camera({DEVICE!r}))"
    done = run(sys.executable, "-c", code, env=FakeVideo(tmp_path, traits).env, cwd=ROOT)
    sizes = ["160x120", "320x240"]
    assert done.stdout.strip() == str({"YUYV": sizes, "MJPG": sizes})


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"device": "/dev/video77"}, r"no camera at /dev/video77 \(No such file.*; .*--device$"),
        ({"encoding": "jpeg"}, f"the camera {DEVICE} gives no jpeg; it offers: YUYV$"),
    ],
)
def test_a_missing_camera_is_one_clear_line(
    video: FakeVideo, wanted: dict[str, str], said: str
) -> None:
    running = Probe(video, **wanted)
    assert re.fullmatch(f"Camera: {said}", running.next()["error"])
    running.end()


def test_it_keeps_the_contract_of_cameras(tmp_path: Path) -> None:
    words = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k")
    suite = ("v4l2 and not frozen", "tests/contract/test_cameras.py")
    done = run(*words, *suite, env=FakeVideo(tmp_path).env, cwd=ROOT)
    assert done.returncode == 0, done.stdout[-3000:]
    assert "passed" in done.stdout and "skipped" not in done.stdout


def test_the_numbers_are_those_of_the_kernel_headers(tmp_path: Path) -> None:
    names = NUMBERS.split()
    lines = "".join(f'printf("%lu\\n", (unsigned long)VIDIOC_{name});' for name in names)
    source = tmp_path / "numbers.c"
    source.write_text(
        "#include <stdio.h>\n#include <sys/time.h>\n#include <linux/videodev2.h>\n"
        f"int main(void) {{ {lines} return 0; }}\n"
    )
    FakeVideo(tmp_path)  # skips where there is no compiler
    subprocess.run(["cc", "-o", tmp_path / "numbers", source], check=True)
    printed = run(tmp_path / "numbers", check=True)
    assert [getattr(v4l2, name) for name in names] == [int(n) for n in printed.stdout.split()]


def test_freshness_tells_silence_from_repetition() -> None:
    freshness = Freshness(10.0)
    still_s = STILL_S
    assert freshness.is_new(b"a", 10.1)
    assert not freshness.is_new(b"a", 10.1 + still_s)
    assert freshness.fault(10.09 + still_s) is None
    assert freshness.fault(10.12 + still_s) == "repeats one picture"
    assert freshness.fault(10.12 + 2 * still_s + LONGEST_PERIOD_S) == "gives no pictures"
    assert freshness.is_new(b"b", 11.1)
    assert freshness.fault(11.2) is None


class BreakableVideo:
    """A camera of 30 pictures a second on the test's clock, until it breaks."""

    how, now_s = "run", 100.0
    path, width, height, encoding = DEVICE, 160, 120, "yuyv"

    def __init__(self, *wanted: object) -> None:
        if self.how == "gone":
            raise v4l2.CaptureError("there is none")
        self._shown_s = 0.0
        self._last = b""

    def read(self) -> v4l2.VideoFrame | None:
        if self.how == "gone":
            raise OSError(19, "No such device")
        if self.how == "freeze" or self.now_s - self._shown_s < 1 / 30:
            return None
        self._shown_s = self.now_s
        self._last = self._last if self.how == "repeat" else b"%f" % self.now_s
        return v4l2.VideoFrame(self._last, self.now_s)

    def close(self) -> None:
        """There is nothing to close."""


@pytest.mark.parametrize("how", ["freeze", "repeat", "gone"])
def test_a_broken_camera_is_noticed_within_500_ms_and_picked_up_again(
    monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    monkeypatch.setattr(reader, "Video", BreakableVideo)
    monkeypatch.setattr(BreakableVideo, "how", "run")
    monkeypatch.setattr(BreakableVideo, "now_s", 100.0)
    camera = reader.CameraReader(DEVICE, 160, 120, 30, "auto")

    def until(is_so: Callable[[], bool]) -> float:
        start_s = BreakableVideo.now_s
        while not is_so():
            BreakableVideo.now_s += 0.005
            camera.poll(BreakableVideo.now_s)
            assert BreakableVideo.now_s - start_s < 5.0, "waited in vain"
        return BreakableVideo.now_s - start_s

    until(lambda: BreakableVideo.now_s > 101.0)
    assert camera.fault is None
    BreakableVideo.how = how
    assert until(lambda: camera.fault is not None) <= 0.5
    assert DEVICE in (camera.fault or "")
    BreakableVideo.how = "run"
    assert until(lambda: camera.fault is None) <= REOPEN_S + 0.1


@pytest.mark.parametrize("serial", ["its own", "the same"])
def test_a_camera_that_was_unplugged_is_not_replaced_by_its_twin(
    monkeypatch: pytest.MonkeyPatch, serial: str
) -> None:
    """tests/robot/devkit/test_usb_camera.py tests how cameras are told apart."""
    plugged: dict[str, UsbCamera] = {}

    class PluggedVideo(BreakableVideo):
        def __init__(self, path: str, *wanted: object) -> None:
            super().__init__()
            self.path, self.camera = path, plugged[path]

        def read(self) -> v4l2.VideoFrame | None:
            if self.camera not in plugged.values():
                raise OSError(19, "No such device")
            return super().read()

    def plug(number: int, serial: str) -> None:
        path = f"/dev/video{number}"
        plugged[path] = UsbCamera(path, "C270", "046d 0825", serial, f"1-{number}", "1.0 0")

    def path_after_a_while() -> str:
        for _ in range(100):
            BreakableVideo.now_s += 0.1
            camera.poll(BreakableVideo.now_s)
        return camera.video.path if camera.video else ""

    monkeypatch.setattr(usb_camera, "list_usb_cameras", lambda root=None: [*plugged.values()])
    monkeypatch.setattr(reader, "Video", PluggedVideo)
    monkeypatch.setattr(BreakableVideo, "now_s", 100.0)
    plug(0, "the same")
    plug(5, "a third")
    camera = reader.CameraReader("auto", 160, 120, 30, "auto")
    assert path_after_a_while() == "" and "2 cameras are plugged in" in str(camera.fault)
    del plugged["/dev/video5"]
    assert path_after_a_while() == "/dev/video0"
    plug(2, serial)
    del plugged["/dev/video0"]
    assert path_after_a_while() == ""
    plug(0, "the same")
    assert path_after_a_while() == "/dev/video0"


@given(st.lists(st.floats(0.02, 0.2), min_size=3, max_size=40), st.integers(2, 20))
def test_a_slow_camera_is_not_taken_for_a_silent_one(gaps: list[float], lost: int) -> None:
    freshness = Freshness(0.0)
    now_s = 0.0
    for index, gap in enumerate(gaps):
        now_s += gap
        assert freshness.is_new(b"%d" % index, now_s)
        assert freshness.fault(now_s + gap) is None
    assert freshness.fault(now_s + STILL_S) is None
    assert freshness.fault(now_s + 0.5 + max(gaps)) == "gives no pictures"


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
