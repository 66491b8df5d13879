"""A ridge for one who is taught at every frame and asked seldom: it learns frames in blocks.

The inverse is large, and a block reads and writes it once: 32 frames together cost less than half
of what they cost one by one. Frames that wait for their block count already in what it is asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import MOST_VALUES, Array, Arrays, Params, Stateful, first_rows
from robot.learner.ridge import Floats, RecursiveRidge

BLOCK = 32


class BlockRidge(Stateful):
    """Learns as a `RecursiveRidge` does, a block at a time.

    What it knows does not depend on when it was asked.

    Args:
        ridge: What it learns with. Nobody else may use it.
    """

    fields = (
        Array("block_frames", np.float64, (BLOCK, "size"), -MOST_VALUES, MOST_VALUES, "_frames"),
        Array("block_targets", np.float64, (BLOCK, "n_labels"), 0.0, 1.0, "_targets"),
    )

    def __init__(self, ridge: RecursiveRidge) -> None:
        self.size = ridge.size
        self._ridge = ridge
        self._frames = np.zeros((BLOCK, ridge.size))
        self._targets = np.zeros((BLOCK, ridge.n_columns))
        self._n_waiting = 0
        self._weights: Floats | None = None

    def add_label(self) -> None:
        """Add a label, which no frame so far had."""
        self._ridge.add_label()
        self._targets = np.hstack([self._targets, np.zeros((BLOCK, 1))])
        self._weights = None

    def scores(self, x: NDArray[Any]) -> Floats:
        """Return one score a label, as `RecursiveRidge.scores`."""
        if not self._n_waiting:
            return self._ridge.scores(x)
        if self._weights is None:
            self._weights = self._ridge.weights_after(*self._waiting())
        scores: Floats = self._ridge.scaled(x) @ self._weights
        return scores

    def learn_scaled(self, z: Floats, targets: Floats, weight: float = 1.0) -> None:
        """Add a frame that the ridge has scaled `weight` times, with its target scores."""
        root = math.sqrt(weight)
        self._frames[self._n_waiting] = root * z
        self._targets[self._n_waiting] = root * targets
        self._n_waiting += 1
        self._weights = None
        if self._n_waiting == BLOCK:
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
        if self._n_waiting:
            self._ridge.learn_block(*self._waiting())
            self._frames[:], self._targets[:] = 0.0, 0.0
        self._n_waiting, self._weights = 0, None

    def _waiting(self) -> tuple[Floats, Floats]:
        return self._frames[: self._n_waiting], self._targets[: self._n_waiting]

    @property
    def is_indefinite(self) -> bool:
        """True if what was learned before the block is."""
        return self._ridge.is_indefinite

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        return (("", self._ridge),)

    def upgrade(self, params: Params, arrays: Arrays) -> None:
        """Let nothing wait where a `RecursiveRidge` was saved."""
        if not {"block_frames", "block_targets"} & arrays.keys():
            arrays["block_frames"] = np.zeros((BLOCK, self.size))
            arrays["block_targets"] = np.zeros((BLOCK, arrays["linear"].shape[1]))

    def restored(self) -> None:
        self._n_waiting, self._weights = int(self._frames[:, -1].astype(bool).sum()), None

    def faults(self) -> Iterator[str]:
        n = self._n_waiting
        if n == BLOCK or first_rows(self._frames) != n or self._targets[n:].any():
            yield "the array block_frames is over-full, or has gaps"
