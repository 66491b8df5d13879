"""Frames of any pixels, for the tests of features."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.types import Encoding, Frame


def frame_of(pixels: NDArray[Any]) -> Frame:
    """Return a frame of colours, shape (height, width, 3), or of grey values, (height, width)."""
    rgb = pixels.astype(np.uint8)
    if rgb.ndim == 2:
        rgb = np.repeat(rgb[:, :, None], 3, axis=2)
    height, width = rgb.shape[:2]
    return Frame(
        frame_id=1,
        captured_s=0.0,
        width=width,
        height=height,
        encoding=Encoding.RGB,
        data=rgb.tobytes(),
    )
