"""A simulated camera at /dev/video9, for processes that are started with its environment."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import tempfile
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

DEVICE = "/dev/video9"


@dataclass(frozen=True, kw_only=True)
class CameraTraits:
    """The properties of a camera.

    The defaults are a Logitech C270 on an EV3's USB 1.1 bus: YUYV alone, ten pictures a second,
    95 to 145 ms old by the kernel's stamp, now and then one lost or sent twice.
    """

    format: str = "YUYV"
    sizes: str = "160x120"
    period_ms: int = 100
    jitter_ms: int = 10
    age_ms: int = 95
    age_spread_ms: int = 50
    bus_kbs: int = 920
    lose: int = 47
    repeat: int = 61

    def environment(self) -> dict[str, str]:
        told = {name.upper(): str(value) for name, value in asdict(self).items()}
        return {f"FAKE_VIDEO_{name}": value for name, value in told.items()}


C270_ON_EV3 = CameraTraits()
QUICK = CameraTraits(
    period_ms=33, jitter_ms=0, age_ms=5, age_spread_ms=0, bus_kbs=0, lose=0, repeat=0
)
"""A webcam on a laptop's bus."""


@cache
def _library() -> Path:
    """Build the preload library, once in a process."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler, so no made-up camera")
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder)
    library = Path(folder) / "fake_video.so"
    source = Path(__file__).with_name("fake_video.c")
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-Wall", "-Werror", "-o", library, source, "-ldl"],
        check=True,
    )
    return library


class FakeVideo:
    """Uses the preload library; `env` is the environment for a process that sees the camera."""

    def __init__(self, folder: Path, traits: CameraTraits = C270_ON_EV3) -> None:
        library = _library()
        self.control = folder / "camera"
        jpeg = folder / "picture.jpg"
        ramp = np.tile(np.arange(160, dtype=np.uint8), (120, 1))
        jpeg.write_bytes(cv2.imencode(".jpg", ramp)[1].tobytes())
        self.behave("run")
        self.env = {
            **os.environ,
            "LD_PRELOAD": str(library),
            "FAKE_VIDEO": str(self.control),
            **traits.environment(),
            "FAKE_VIDEO_JPEG": str(jpeg),
        }

    def behave(self, how: str) -> None:
        """One of run, repeat, freeze and gone."""
        fresh = self.control.with_suffix(".new")
        fresh.write_text(how)
        fresh.rename(self.control)
