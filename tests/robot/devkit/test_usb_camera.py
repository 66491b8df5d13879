"""A camera that is plugged in again is recognised by its identity, and its twin is not used."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from robot.bodies.webcam.camera import OpencvCamera, OpencvOptions
from robot.devkit import usb_camera
from robot.devkit.usb_camera import SameCamera, SeveralCamerasError
from robot.errors import CameraError
from robot.testing import VirtualClock


@pytest.fixture(autouse=True)
def _system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(usb_camera, "ROOT", str(tmp_path / "class"))


def plug(root: Path, number: int, port: str, serial: str = "", interface: int = 0) -> None:
    """Create the files by which Linux shows a USB camera."""
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
    assert mine.is_absent, "its twin is there"
    assert mine.device == "HD Webcam C270 (USB socket 1-2)"
    plug(tmp_path, 1, "1-2", serial)
    assert mine.find() == "/dev/video1"


def test_of_several_cameras_one_has_to_be_named(tmp_path: Path) -> None:
    assert SameCamera("auto").find() == "auto", "the first that the system has"
    plug(tmp_path, 10, "1-3")
    plug(tmp_path, 2, "1-2")
    with pytest.raises(SeveralCamerasError, match=r"2 cameras .*video10\).*--device /dev/video2$"):
        SameCamera("auto").find()
    assert SameCamera("/dev/video10").find() == "/dev/video10"


def test_the_infrared_camera_of_a_laptop_is_no_twin(tmp_path: Path) -> None:
    plug(tmp_path, 0, "1-6", "A17")
    plug(tmp_path, 2, "1-6", "A17", interface=2)
    mine = opened("auto")
    assert mine.find() == "/dev/video0"
    unplug(tmp_path, 0)
    mine.lost()
    assert mine.is_absent


class Capturing:
    """OpenCV, reduced to opening a camera by its number."""

    CAP_PROP_FRAME_WIDTH, CAP_PROP_FRAME_HEIGHT, CAP_PROP_BUFFERSIZE = 3, 4, 38

    def __init__(self) -> None:
        self.opened: list[int] = []

    def VideoCapture(self, number: int) -> Any:  # noqa: N802 - OpenCV's name
        self.opened.append(number)
        return SimpleNamespace(isOpened=lambda: True, set=lambda *_: True)


@pytest.mark.parametrize("source", ["0", "auto", "/dev/video0"])
def test_a_webcam_that_was_lost_is_not_replaced_by_another(tmp_path: Path, source: str) -> None:
    plug(tmp_path, 0, "1-2")
    camera = OpencvCamera(OpencvOptions(source=source), VirtualClock())
    camera._cv2 = cv2 = Capturing()
    assert camera._open() is not None
    unplug(tmp_path, 0)
    assert camera._open() is None
    plug(tmp_path, 0, "1-9")  # the system gives it the number that became free
    assert camera._open() is None and cv2.opened == [0]
    assert "C270 (USB socket 1-2) is unplugged, and no other" in camera._name_fault("gives nothing")
    plug(tmp_path, 2, "1-2")
    assert camera._open() is not None and cv2.opened == [0, 2]


def test_opencv_takes_none_of_several_cameras_either(tmp_path: Path) -> None:
    plug(tmp_path, 0, "1-2")
    plug(tmp_path, 1, "1-3")
    with (
        mock.patch("robot.bodies.webcam.camera.need", lambda *_: Capturing()),
        pytest.raises(CameraError, match=r"2 cameras .*--source /dev/video0"),
    ):
        OpencvCamera(OpencvOptions(), VirtualClock()).start()
