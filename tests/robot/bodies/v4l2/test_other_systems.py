"""The camera for Linux on another system names the camera to use instead."""

from __future__ import annotations

import sys

from tests.kit.run import run

_WITHOUT_LINUX = """
import sys, numpy  # it asks for what is gone below
sys.modules["fcntl"] = None
import os
vars(os).pop("O_NONBLOCK", None)
from robot.bodies.v4l2.device import CaptureError, describe_camera, list_cameras
try:
    describe_camera("/dev/video0")
except CaptureError as error:
    print(error)
"""


def test_on_other_systems_another_camera_is_suggested() -> None:
    done = run(sys.executable, "-c", _WITHOUT_LINUX, encoding="utf-8")
    assert "--camera opencv" in done.stdout
