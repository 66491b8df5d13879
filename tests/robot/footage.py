"""Small generated recordings in the format of real ones."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np


def write_footage(path: Path, *, n_frames: int, seed: int = 0, period_s: float = 0.02) -> Path:
    """Write a recording of `n_frames` pictures of noise; return its path."""
    noise = np.random.default_rng(seed)
    files = []
    for _ in range(n_frames):
        coarse = noise.integers(0, 256, (12, 16, 3), dtype=np.uint8)
        files.append(cv2.imencode(".jpg", coarse.repeat(10, axis=0).repeat(10, axis=1))[1])
    np.savez(
        path,
        jpeg=np.concatenate([file.ravel() for file in files]),
        offsets=np.cumsum([0, *(file.size for file in files)]).astype(np.int64),
        labels=(np.arange(n_frames) % 3).astype(np.uint8),
        t=(np.arange(n_frames) * period_s).astype(np.float32),
        meta=np.array(json.dumps({"source": "noise"})),
    )
    return path
