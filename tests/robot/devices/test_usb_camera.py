"""A camera that is plugged in again is found by what it is, and its twin is not taken."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from robot.bodies.webcam.camera import OpencvCamera, OpencvOptions
from robot.devices.usb_camera import identity_of, number_of
from robot.testing import VirtualClock


def plug(root: Path, number: int, port: str, serial: str = "") -> None:
    """Lay out what Linux shows of a USB camera."""
    device = root / "devices" / port
    (device / f"{port}:1.0").mkdir(parents=True, exist_ok=True)
    (device / "idVendor").write_text("046d\n")
    (device / "idProduct").write_text("0825\n")
    if serial:
        (device / "serial").write_text(f"{serial}\n")
    node = root / "class" / f"video{number}"
    node.mkdir(parents=True)
    (node / "device").symlink_to(device / f"{port}:1.0")
    (node / "index").write_text("0\n")


def unplug(root: Path, number: int) -> None:
    node = root / "class" / f"video{number}"
    (node / "device").unlink()
    (node / "index").unlink()
    node.rmdir()


def test_a_camera_gets_another_number_and_is_still_the_same(tmp_path: Path) -> None:
    there = tmp_path / "class"
    plug(tmp_path, 0, "1-2", "A17")
    plug(tmp_path, 2, "1-3", "B42")
    mine = identity_of(0, there)
    assert mine is not None and number_of(mine, there) == 0
    unplug(tmp_path, 0)
    assert number_of(mine, there) is None
    plug(tmp_path, 4, "1-4", "A17")
    assert number_of(mine, there) == 4


def test_twins_without_a_serial_number_are_told_apart_by_their_socket(tmp_path: Path) -> None:
    there = tmp_path / "class"
    plug(tmp_path, 0, "1-2")
    plug(tmp_path, 2, "1-3")
    mine = identity_of(0, there)
    assert mine is not None and mine != identity_of(2, there)
    unplug(tmp_path, 0)
    assert number_of(mine, there) is None, "its twin is there"
    plug(tmp_path, 1, "1-2")
    assert number_of(mine, there) == 1
    assert identity_of(7, there) is None and number_of(mine, tmp_path / "none") is None


@pytest.mark.parametrize("has_twin", [False, True])
def test_a_webcam_that_was_lost_is_not_replaced_by_another(tmp_path: Path, has_twin: bool) -> None:
    plug(tmp_path, 0, "1-2")
    opened: list[int] = []

    def capture(number: int) -> Any:
        opened.append(number)
        return mock.Mock(isOpened=lambda: True)

    there = tmp_path / "class"
    camera = OpencvCamera(OpencvOptions(), VirtualClock())
    camera._cv2 = SimpleNamespace(
        VideoCapture=capture,
        CAP_PROP_FRAME_WIDTH=3,
        CAP_PROP_FRAME_HEIGHT=4,
        CAP_PROP_BUFFERSIZE=38,
    )
    with (
        mock.patch("robot.devices.usb_camera._ROOT", there),
        mock.patch.multiple(
            "robot.bodies.webcam.camera",
            identity_of=lambda number: identity_of(number, there),
            number_of=lambda identity: number_of(identity, there),
        ),
    ):
        assert camera._open() is not None
        unplug(tmp_path, 0)
        if has_twin:
            plug(tmp_path, 0, "1-9")  # the system gives it the number that became free
        assert camera._open() is None and opened == [0]
        assert "no other is taken" in camera._name_fault("gives no pictures")
        plug(tmp_path, 2, "1-2")
        assert camera._open() is not None and opened == [0, 2]
