"""Installs a film of YUYV pictures, and the camera that shows it, as a plugin for a server under
test."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from tests.robot.bodies.ev3 import film_camera

ROOT = Path(__file__).parents[4]


def install_film(folder: Path) -> None:
    """Put the film and its camera into the Python path of the brick."""
    shutil.rmtree(folder, ignore_errors=True)
    metadata = folder / "film-1.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: film\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(film_camera.ENTRY_POINT)
    shutil.copy(film_camera.__file__, folder)
    (folder / "film.yuyv").write_bytes(b"".join(to_yuyv(picture) for picture in pictures()))


def pictures() -> Iterator[np.ndarray]:
    """Frames to drive by: real footage if it is available, otherwise a moving scene."""
    footage = ROOT.parent / "shared/recordings/gym_A.npz"
    if footage.is_file():
        with np.load(footage) as film:
            jpeg, offsets = film["jpeg"], film["offsets"]
        for index in range(0, 600, 6):
            yield cv2.imdecode(jpeg[offsets[index] : offsets[index + 1]], cv2.IMREAD_COLOR)
        return
    noise = np.random.default_rng(1)
    scene = cv2.resize(noise.integers(0, 255, (20, 100, 3), dtype=np.uint8), (800, 120))
    for index in range(100):
        yield scene[:, 6 * index : 6 * index + 160]


def to_yuyv(picture: np.ndarray) -> bytes:
    y, u, v = cv2.split(cv2.cvtColor(picture, cv2.COLOR_BGR2YUV))
    packed = np.empty((film_camera.HEIGHT, film_camera.WIDTH, 2), np.uint8)
    packed[:, :, 0] = y
    packed[:, 0::2, 1], packed[:, 1::2, 1] = u[:, 0::2], v[:, 0::2]
    return packed.tobytes()
