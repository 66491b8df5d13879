"""The base of all cameras: threads, checks of pictures, and the identity of a USB camera."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import cv2
import numpy as np
import pytest

from robot.bodies.mjpeg.camera import MjpegCamera, MjpegOptions
from robot.bodies.webcam.camera import OpencvCamera, OpencvOptions
from robot.devkit import usb_camera
from robot.devkit.pictures import DRIVEN_BY_PX, Picture, check_kind, read_jpeg, reduce_picture
from robot.devkit.threaded_camera import ThreadedCamera, WatchedCamera
from robot.devkit.usb_camera import SameCamera, SeveralCamerasError
from robot.errors import CameraError, RecordingError
from robot.testing import VirtualClock
from robot.types import Encoding


class BenchCamera(ThreadedCamera):
    name = "bench"

    def _begin(self) -> None:
        """Take no pictures."""


class WideCamera(BenchCamera):
    def _begin(self) -> None:
        """Take pictures of 2x1 and then of 70,000x1 pixels, on a thread."""

        def take() -> None:
            for width in (2, 70_000):
                picture = Picture(
                    encoding=Encoding.RGB, width=width, height=1, data=bytes(3 * width)
                )
                self._show_picture(picture, self.clock.now_s())

        self._work(take)


def test_a_picture_that_is_too_wide_for_a_message_is_a_fault_that_names_its_size() -> None:
    clock = VirtualClock()
    camera = WideCamera(None, clock)
    camera.start()
    clock.sleep(1.0)
    assert "bench gives pictures of 70000x1 pixels" in (camera.fault or "")
    frame = camera.latest()
    assert frame is not None and frame.width == 2
    camera.stop()


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> VirtualClock:
    """The kernel's clock, which stamps the pictures of kernel drivers."""
    clock = VirtualClock(50.0)
    monkeypatch.setattr("robot.devkit.threaded_camera.time", SimpleNamespace(monotonic=clock.now_s))
    return clock


@pytest.mark.parametrize("ahead_s", [0.0, 3600.0])
def test_a_picture_keeps_its_age_on_any_clock_and_never_seems_younger(
    machine: VirtualClock, ahead_s: float
) -> None:
    class Slow(VirtualClock):
        """A clock that delays the thread after each reading."""

        def now_s(self) -> float:
            read_s = machine.now_s() + ahead_s
            machine.advance(0.003)
            return read_s

    taken_s = machine.now_s() - 0.25
    shown_s = BenchCamera(None, Slow())._on_clock(taken_s)
    assert taken_s + ahead_s - 0.01 < shown_s <= taken_s + ahead_s


@pytest.mark.parametrize("side", [np.int64(2), np.float32(2.0), 2.0])
def test_a_frame_has_plain_numbers_whatever_the_camera_passes(side: Any) -> None:
    camera = BenchCamera(None, VirtualClock())
    frame = camera._publish(
        bytes(12), width=side, height=side, encoding=Encoding.RGB, captured_s=np.float64(0.0)
    )
    assert {type(frame.width), type(frame.height)} == {int} and frame.width == frame.height == 2


@pytest.mark.parametrize("data", [bytearray(12), np.zeros(12, np.uint8)], ids=["bytes", "array"])
def test_a_frame_does_not_change_when_the_camera_reuses_its_memory(data: Any) -> None:
    """Some libraries reuse one array for all pictures, and OpenCV returns a JPEG as an array."""
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
        camera._report_fault(OSError("unplugged"))
    assert told == ["unplugged"]


@pytest.mark.parametrize("base", [ThreadedCamera, WatchedCamera])
@pytest.mark.parametrize("error", [CameraError("The cable is out."), KeyError("exposure")], ids=str)
def test_an_error_of_a_cameras_thread_becomes_its_fault(base: Any, error: Exception) -> None:
    class Broken(base):
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
    assert camera.fault is None, "stopping a camera is not a fault"


def jpeg(width: int, height: int) -> bytes:
    ramp = np.linspace(0, 255, width, dtype=np.uint8)
    pixels = np.repeat(np.tile(ramp, (height, 1))[:, :, None], 3, axis=2)
    return cv2.imencode(".jpg", pixels)[1].tobytes()


@pytest.mark.parametrize("size", [(4096, 2160), (3000, 4000), (1281, 960)])
def test_a_picture_of_many_megapixels_is_passed_on_smaller(size: tuple[int, int]) -> None:
    big = read_jpeg(jpeg(*size))
    small = reduce_picture(big)
    assert small.width * small.height <= DRIVEN_BY_PX
    assert small.width / small.height == pytest.approx(size[0] / size[1], rel=0.02)
    assert read_jpeg(small.data).width == small.width
    pixels = cv2.imdecode(np.frombuffer(small.data, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert pixels[:, 2].mean() < 30 < 220 < pixels[:, -3].mean()


def test_a_picture_that_is_small_enough_keeps_its_bytes() -> None:
    usual = read_jpeg(jpeg(640, 480))
    assert reduce_picture(usual) is usual


def test_a_lossless_jpeg_is_reported_once_and_not_with_each_picture() -> None:
    usual = jpeg(64, 48)
    check_kind(usual)
    lossless = usual.replace(b"\xff\xc0", b"\xff\xc3", 1)
    with pytest.raises(RecordingError, match=r"lossless JPEGs.*choose baseline JPEG"):
        check_kind(lossless)
    check_kind(b"\xff\xd8\xff\xe0" + struct.pack(">H", 9))  # the JPEG is cut in its first scan
    camera = MjpegCamera(MjpegOptions(source="http://192.0.2.1/"), VirtualClock())
    said = set()
    for _ in range(3):
        camera._take(lossless, 0.0)
        said.add(camera._name_fault("gives no pictures"))
    assert len(said) == 1 and "lossless" in said.pop()


def test_an_earlier_fault_of_a_camera_is_not_reported_after_it_is_back() -> None:
    """A camera's server that was restarted may repeat its earlier picture."""
    camera = MjpegCamera(MjpegOptions(source="http://192.0.2.1/"), VirtualClock())
    camera._take(jpeg(64, 48), 0.0)
    camera._reason = "it has answered and sends nothing"
    camera._take(jpeg(64, 48), 1.0)
    assert camera._name_fault("repeats one picture").endswith("repeats one picture; restart it.")
    camera._reason = "the stream ended"
    assert camera._name_fault("repeats one picture").endswith("no pictures (the stream ended).")


@pytest.fixture(autouse=True)
def _system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(usb_camera, "ROOT", str(tmp_path / "class"))


def plug(root: Path, number: int, port: str, serial: str = "", interface: int = 0) -> None:
    """Create the files of a USB camera, like Linux."""
    device = root / "devices" / port
    part = device / f"{port}:1.{interface}"
    part.mkdir(parents=True, exist_ok=True)
    (device / "idVendor").write_text("046d\n")
    (device / "idProduct").write_text("0825\n")
    if serial:
        (device / "serial").write_text(f"{serial}\n")
    node = root / "class" / f"video{number}"
    node.mkdir(parents=True)
    (node / "device").symlink_to(part)
    (node / "index").write_text("0\n")
    (node / "name").write_text("HD Webcam C270\n")


def unplug(root: Path, number: int) -> None:
    shutil.rmtree(root / "class" / f"video{number}")


def opened(wanted: str) -> SameCamera:
    same = SameCamera(wanted)
    path = same.find()
    assert path is not None
    same.opened(path)
    return same


def test_a_camera_gets_another_number_and_is_still_the_same(tmp_path: Path) -> None:
    plug(tmp_path, 0, "1-2", "A17")
    plug(tmp_path, 2, "1-3", "B42")
    mine = opened("/dev/video0")
    assert mine.device == "HD Webcam C270 (serial number A17)" and mine.find() == "/dev/video0"
    unplug(tmp_path, 0)
    mine.lost()
    assert mine.is_absent
    plug(tmp_path, 4, "1-4", "A17")
    assert mine.find() == "/dev/video4"


@pytest.mark.parametrize("serial", ["", "200901010001"])
def test_twins_without_a_serial_number_of_their_own_are_told_apart_by_their_socket(
    tmp_path: Path, serial: str
) -> None:
    plug(tmp_path, 0, "1-2", serial)
    mine = opened("auto")
    plug(tmp_path, 2, "1-3", serial)
    unplug(tmp_path, 0)
    mine.lost()
    assert mine.is_absent, "the driver does not take the camera's twin"
    assert mine.device == "HD Webcam C270 (USB socket 1-2)"
    plug(tmp_path, 1, "1-2", serial)
    assert mine.find() == "/dev/video1"


def test_of_several_cameras_one_has_to_be_named(tmp_path: Path) -> None:
    assert SameCamera("auto").find() == "auto", "auto means the first camera of the system"
    plug(tmp_path, 10, "1-3")
    plug(tmp_path, 2, "1-2")
    with pytest.raises(SeveralCamerasError, match=r"2 cameras .*video10\).*--device /dev/video2$"):
        SameCamera("auto").find()
    assert SameCamera("/dev/video10").find() == "/dev/video10"


def test_a_laptops_infrared_camera_does_not_count_as_a_second_camera(tmp_path: Path) -> None:
    plug(tmp_path, 0, "1-6", "A17")
    plug(tmp_path, 2, "1-6", "A17", interface=2)
    mine = opened("auto")
    assert mine.find() == "/dev/video0"
    unplug(tmp_path, 0)
    mine.lost()
    assert mine.is_absent


@pytest.mark.parametrize("source", ["0", "auto", "/dev/video0"])
def test_a_webcam_that_was_lost_is_not_replaced_by_another(tmp_path: Path, source: str) -> None:
    plug(tmp_path, 0, "1-2")
    camera = OpencvCamera(OpencvOptions(source=source), VirtualClock())
    camera._cv2 = cv2 = mock.Mock()
    assert camera._open() is not None
    unplug(tmp_path, 0)
    assert camera._open() is None
    plug(tmp_path, 0, "1-9")  # the new camera gets the free number
    assert camera._open() is None and cv2.VideoCapture.call_args_list == [mock.call(0)]
    assert "C270 (USB socket 1-2) is unplugged, and no other" in camera._name_fault("gives nothing")
    plug(tmp_path, 2, "1-2")
    assert camera._open() is not None and cv2.VideoCapture.call_args == mock.call(2)


def test_opencv_does_not_choose_among_several_cameras_either(tmp_path: Path) -> None:
    plug(tmp_path, 0, "1-2")
    plug(tmp_path, 1, "1-3")
    with (
        mock.patch("robot.bodies.webcam.camera.need"),
        pytest.raises(CameraError, match=r"2 cameras .*--source /dev/video0"),
    ):
        OpencvCamera(OpencvOptions(), VirtualClock()).start()
