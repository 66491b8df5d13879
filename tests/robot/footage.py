"""Small generated recordings in the format of real recordings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np


def write_footage(
    path: Path, n_frames: int = 12, seed: int = 0, period_s: float = 0.1, **changes: Any
) -> Path:
    """Write a recording of pictures whose brightness is their label, with noise; return its path.

    Args:
        path: Its folder is made if there is none.
        n_frames: Their labels are forward, left and right in turn.
        seed: The seed of the noise.
        period_s: The time between two pictures.
        changes: Other arrays, by name; None leaves an array out.
    """
    noise = np.random.default_rng(seed)
    labels = (np.arange(n_frames) % 3).astype(np.uint8)
    files = []
    for label in labels.tolist():
        coarse = (60 * label + noise.integers(0, 30, (12, 16))).astype(np.uint8)
        files.append(cv2.imencode(".jpg", coarse.repeat(10, axis=0).repeat(10, axis=1))[1].ravel())
    arrays = {
        "jpeg": np.concatenate(files),
        "offsets": np.cumsum([0, *(file.size for file in files)]).astype(np.int64),
        "labels": labels,
        "t": (np.arange(n_frames) * period_s).astype(np.float32),
        "meta": np.array(json.dumps({"source": "test"})),
    } | changes
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    return path
