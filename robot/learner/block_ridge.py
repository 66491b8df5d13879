"""A ridge for one who is taught at every frame and asked seldom: it learns frames in blocks.

The inverse is large, and a block reads and writes it once: 32 frames together cost less than half
of what they cost one by one. Frames that wait for their block count already in what it is asked.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.ridge import Floats, RecursiveRidge

BLOCK = 32


class BlockRidge:
    """Learns as a `RecursiveRidge` does, a block at a time.

    What it knows does not depend on when it was asked.

    Args:
        ridge: What it learns with. Nobody else may use it.
    """

    def __init__(self, ridge: RecursiveRidge) -> None:
        self._ridge = ridge
        self._frames: list[Floats] = []
        self._targets: list[Floats] = []
        self._weights: Floats | None = None

    def add_label(self) -> None:
        """Add a label, which no frame so far had."""
        self._ridge.add_label()
        self._targets = [np.append(targets, 0.0) for targets in self._targets]
        self._weights = None

    def scores(self, x: NDArray[Any]) -> Floats:
        """Return one score a label, as `RecursiveRidge.scores`."""
        if not self._frames:
            return self._ridge.scores(x)
        if self._weights is None:
            self._weights = self._ridge.weights_after(*self._waiting())
        scores: Floats = self._ridge.scaled(x) @ self._weights
        return scores

    def learn_scaled(self, z: Floats, targets: Floats, weight: float = 1.0) -> None:
        """Add a frame that the ridge has scaled `weight` times, with its target scores."""
        root = math.sqrt(weight)
        self._frames.append(root * z)
        self._targets.append(root * targets)
        self._weights = None
        if len(self._frames) == BLOCK:
            self._write()

    def learn(self, x: NDArray[Any], targets: Floats, weight: float = 1.0) -> None:
        """Add a frame `weight` times, or take it back, as `RecursiveRidge.learn`."""
        self._write()
        self._ridge.learn(x, targets, weight)

    def retarget(self, x: NDArray[Any], change: Floats) -> None:
        """Change the targets of frames, as `RecursiveRidge.retarget`."""
        self._write()
        self._ridge.retarget(x, change)

    def _write(self) -> None:
        if self._frames:
            self._ridge.learn_block(*self._waiting())
        self._frames, self._targets, self._weights = [], [], None

    def _waiting(self) -> tuple[Floats, Floats]:
        return np.array(self._frames), np.array(self._targets)

    def get_arrays(self) -> dict[str, NDArray[Any]]:
        """Return copies of all that was learned, and of the frames that wait for their block."""
        arrays = self._ridge.get_arrays()
        n_waiting, n_labels = len(self._frames), arrays["linear"].shape[1]
        frames, targets = np.zeros((BLOCK, self._ridge.n_features + 1)), np.zeros((BLOCK, n_labels))
        if n_waiting:
            frames[:n_waiting], targets[:n_waiting] = self._waiting()
        return {**arrays, "block_frames": frames, "block_targets": targets}

    def set_arrays(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Restore what `get_arrays` returned, or a `RecursiveRidge` did; raises as that."""
        self._ridge.set_arrays(arrays)
        self._frames, self._targets, self._weights = [], [], None
        if "block_frames" in arrays:
            # The constant of a frame is not 0, that of an empty row 0.
            n_waiting = int(arrays["block_frames"][:, -1].astype(bool).sum())
            self._frames = list(arrays["block_frames"][:n_waiting].copy())
            self._targets = list(arrays["block_targets"][:n_waiting].copy())
