"""Frames for tests."""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.types import Encoding, Frame


def make_frame(
    data: bytes,
    encoding: Encoding,
    width: int = 160,
    height: int = 120,
    frame_id: int = 1,
    captured_s: float = 0.0,
) -> Frame:
    """Return a frame, by default of the cameras' size; the bytes need not be a picture."""
    return Frame(
        frame_id=frame_id,
        captured_s=captured_s,
        width=width,
        height=height,
        encoding=encoding,
        data=data,
    )


def jpeg_frame(frame_id: int, captured_s: float, data: bytes, width: int = 160) -> Frame:
    return make_frame(data, Encoding.JPEG, width, 120, frame_id, captured_s)


def frame_of(pixels: NDArray[Any], frame_id: int = 1, captured_s: float = 0.0) -> Frame:
    """Return a frame of an RGB or grey picture, shape (height, width, 3) or (height, width)."""
    rgb = pixels.astype(np.uint8)
    if rgb.ndim == 2:
        rgb = np.repeat(rgb[:, :, None], 3, axis=2)
    height, width = rgb.shape[:2]
    return make_frame(rgb.tobytes(), Encoding.RGB, width, height, frame_id, captured_s)


def grey_jpeg(index: int) -> bytes:
    """Return a JPEG of the size of the cameras, whose grey value depends on the index."""
    grey = np.full((120, 160, 3), 7 * index % 256, np.uint8)
    return cv2.imencode(".jpg", grey)[1].tobytes()


@functools.cache
def noisy_blocks(scene: int, noise: int = 0) -> NDArray[np.uint8]:
    """Return a noisy grey scene, shape (120, 160, 3), which depends on the number."""
    blocks = np.random.default_rng(scene).integers(0, 200, (12, 16))
    pixels = np.kron(blocks, np.ones((10, 10)))[:, :, None].repeat(3, axis=2)
    seen = np.random.default_rng(1000 + noise).integers(0, 20, pixels.shape)
    return (pixels + seen).astype(np.uint8)
