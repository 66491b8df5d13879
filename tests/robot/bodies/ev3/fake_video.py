"""Simulates a camera at /dev/video9 for processes that are started with its environment."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

DEVICE = "/dev/video9"


@cache
def _library() -> Path:
    """Build the preload library, once in a process."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("the simulated camera needs a C compiler")
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder)
    library, source = Path(folder) / "fake_video.so", Path(__file__).with_name("fake_video.c")
    options = ("-shared", "-fPIC", "-Wall", "-Werror", "-o", library)
    subprocess.run([compiler, *options, source, "-ldl"], check=True)
    return library


class FakeVideo:
    """A simulated camera by the preload library; `env` is the environment for a process that sees
    it.

    fake_video.c names the other properties that a camera may have, as variables of the environment.
    """

    def __init__(self, folder: Path) -> None:
        control, jpeg = folder / "camera", folder / "picture.jpg"
        ramp = np.tile(np.arange(160, dtype=np.uint8), (120, 1))
        jpeg.write_bytes(cv2.imencode(".jpg", ramp)[1].tobytes())
        self.env = {
            **os.environ,
            "LD_PRELOAD": str(_library()),
            "FAKE_VIDEO": str(control),
            "FAKE_VIDEO_JPEG": str(jpeg),
        }
        self.behave("run")

    def behave(self, how: str) -> None:
        behave(how, self.env["FAKE_VIDEO"])


def behave(how: str, control: str) -> None:
    """Set the camera's state to run, freeze or gone."""
    fresh = Path(control).with_suffix(".new")
    fresh.write_text(how)
    fresh.rename(control)
