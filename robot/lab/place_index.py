"""The views of one place as strings of bits: how well does another view fit?

The features are those of BRIEF (Calonder et al. 2010) at fixed points: is this spot brighter than
that one? The smallest Hamming distance shows how well a view fits.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import Array, Stateful, Value
from robot.learner.values import count

N_BITS = 512
_VIEWS = 128
_POPCOUNT = np.array([bin(byte).count("1") for byte in range(256)], np.uint16)


class BinaryFeatures:
    """Brightness comparisons on a small grey picture, packed into bytes."""

    def __init__(self, height: int, width: int) -> None:
        rng = np.random.default_rng(7)  # the same points on every machine, for ever
        self.height, self.width = height, width
        rows, columns = rng.integers(0, height, N_BITS), rng.integers(0, width, N_BITS)
        down, across = (rng.integers(-n // 3, n // 3 + 1, N_BITS) for n in (height, width))
        self._one = rows * width + columns
        self._two = (rows + down).clip(0, height - 1) * width + (columns + across).clip(
            0, width - 1
        )

    def extract(self, grey: NDArray[Any]) -> NDArray[np.uint8]:
        """Return the picture's bits, shape (N_BITS / 8,); grey of shape (height * width,)."""
        padded = np.pad(grey.reshape(self.height, self.width).astype(np.int32), 2, mode="edge")
        lines = np.sum([padded[i : i + self.height] for i in range(5)], axis=0)
        smooth = np.sum([lines[:, i : i + self.width] for i in range(5)], axis=0).ravel()
        return np.packbits(smooth[self._one] > smooth[self._two])


class PlaceIndex(Stateful):
    """The stored views of one place; the oldest is dropped when there are too many."""

    fields = (
        Value("n_added", count(), "n_added"),
        Array("views", np.uint8, (range(_VIEWS + 1), N_BITS // 8), attribute="views"),
    )

    def __init__(self) -> None:
        self.views = np.zeros((0, N_BITS // 8), np.uint8)
        self.n_added = 0

    def faults(self) -> Iterator[str]:
        if len(self.views) != min(self.n_added, _VIEWS):
            yield "views of a place are missing"

    def difference(self, bits: NDArray[np.uint8]) -> float:
        """Return the share of bits that differ from the most similar view; 0 if there is none."""
        if len(self.views) == 0:
            return 0.0
        return float(_POPCOUNT[self.views ^ bits].sum(axis=1).min()) / N_BITS

    def add(self, bits: NDArray[np.uint8]) -> None:
        """Keep one more view."""
        if len(self.views) < _VIEWS:
            self.views = np.vstack([self.views, bits])
        else:
            self.views[self.n_added % _VIEWS] = bits
        self.n_added += 1
