"""A made-up camera at /dev/video9, for processes that are started with its environment."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

DEVICE = "/dev/video9"


class FakeVideo:
    """Builds the preload library; `env` is the environment for a process that sees the camera."""

    def __init__(self, folder: Path, formats: str = "YUYV") -> None:
        compiler = shutil.which("gcc") or shutil.which("cc")
        if compiler is None:
            pytest.skip("no C compiler, so no made-up camera")
        library = folder / "fake_video.so"
        source = Path(__file__).with_name("fake_video.c")
        subprocess.run(
            [compiler, "-shared", "-fPIC", "-Wall", "-Werror", "-o", library, source, "-ldl"],
            check=True,
        )
        self.control = folder / "camera"
        jpeg = folder / "picture.jpg"
        ramp = np.tile(np.arange(160, dtype=np.uint8), (120, 1))
        jpeg.write_bytes(cv2.imencode(".jpg", ramp)[1].tobytes())
        self.behave("run")
        self.env = {
            **os.environ,
            "LD_PRELOAD": str(library),
            "FAKE_VIDEO": str(self.control),
            "FAKE_VIDEO_FORMAT": formats,
            "FAKE_VIDEO_JPEG": str(jpeg),
        }

    def behave(self, how: str) -> None:
        """run, repeat, freeze or gone."""
        fresh = self.control.with_suffix(".new")
        fresh.write_text(how)
        fresh.rename(self.control)
