"""Stores and compares the nodes' images in integers only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector, checked_vector
from robot.learner.bsoc import Floats, Images
from robot.learner.part import Array

_INT32 = 2**31
_MOST_STEPS, _FEWEST_STEPS = 256, 16
"""Largest and smallest number of steps into which `IntegerImages` divides a grey level."""


class IntegerImages(Images):
    """Images that are compared in integers only, for machines without a floating-point unit.

    Vectors are integers from 0 to 255. A row stores the exact sum of its frames, so precision does
    not depend on the number of frames. Frames are compared with the mean, which is rounded to steps
    of 1/16 to 1/256 of a grey level. With finer steps, the product of two vectors would not fit
    into 32 bits. Products in 64 bits take twice as long on a processor without this unit.

    Args:
        max_nodes: Number of rows.
        n_compared: Number of leading values of a vector that are compared; None for all. The other
            values are only averaged, to show them to people.
    """

    kind = "bsoc-integer"
    fields = (Array("sums", np.int32, ("max_nodes", "d"), high=2**30),)

    def __init__(self, max_nodes: int, n_compared: int | None = None) -> None:
        super().__init__(max_nodes)
        self.n_compared = n_compared
        self._sums = np.zeros((max_nodes, 0), np.int32)
        self._frames = np.zeros(max_nodes, np.int64)
        self._norms = np.zeros(max_nodes)
        self._near: NDArray[Any] = np.zeros(0, np.int32)
        self._steps = _MOST_STEPS

    def begin(self, x: Vector) -> None:
        self._set_sums(np.zeros((self.max_nodes, checked_bytes(x).size), np.int32))

    def _set_sums(self, sums: NDArray[np.int32]) -> None:
        self._sums = sums
        size = min(sums.shape[1], self.n_compared or sums.shape[1])
        self._steps = _MOST_STEPS
        while self._steps > _FEWEST_STEPS and size * 255 * 255 * self._steps >= _INT32:
            self._steps //= 2
        is_short = size * 255 * 255 * self._steps < _INT32
        self._rows = np.zeros((self.max_nodes, size), np.int32 if is_short else np.int64)

    def measure(self, x: Vector, size: int) -> Floats:
        self._x = checked_bytes(x, self._sums.shape[1])
        self._near = near = self._x[: self._rows.shape[1]].astype(self._rows.dtype)
        self._x_norm = 0.5 * float(near.dot(near))
        distances = self._norms[:size] - self._rows[:size].dot(near) / self._steps
        distances += self._x_norm
        single: Floats = np.maximum(distances, 0.0).astype(np.float32)
        return single

    def put(self, row: int) -> None:
        self._sums[row] = self._x
        self._frames[row] = 1
        self._rows[row] = self._near * self._steps
        self._norms[row] = self._x_norm

    def absorb(self, row: int, count: int) -> None:
        sums = self._sums[row]
        np.add(sums, self._x, out=sums, casting="unsafe")  # `x` may have any type of integers
        self._divide(row, count + 1)

    def merge(self, kept: int, removed: int, count_kept: int, count_removed: int) -> None:
        self._sums[kept] += self._sums[removed]
        self._divide(kept, count_kept + count_removed)
        self.put(removed)

    def _divide(self, row: int, count: int) -> None:
        self._frames[row] = count
        sums = self._sums[row, : self._rows.shape[1]]
        if count * 255 * 2 * self._steps >= _INT32:
            sums = sums.astype(np.int64)
        image = (sums * self._steps + count // 2) // count
        self._rows[row] = image
        wide = image.astype(np.int64)
        self._norms[row] = 0.5 * float(wide.dot(wide)) / self._steps**2

    def move(self, source: int, target: int) -> None:
        for array in (self._sums, self._frames, self._rows, self._norms):
            array[target] = array[source]

    def nodes(self, size: int) -> NDArray[np.float32]:
        frames = np.maximum(self._frames[:size, None], 1).astype(np.float32)
        means: NDArray[np.float32] = self._sums[:size].astype(np.float32) / frames
        return means

    def compared(self, size: int) -> Floats:
        return self._rows[:size].astype(np.float32) / np.float32(self._steps)

    def follow(self, counts: NDArray[np.int64]) -> None:
        self._set_sums(self._sums)
        self._frames[:] = 0
        self._norms[:] = 0.0
        for row in np.flatnonzero(counts).tolist():
            self._divide(row, int(counts[row]))

    def faults(self) -> Iterator[str]:
        if (self._sums > 255 * self._frames[:, None]).any():
            yield "the array sums exceeds 255 times the number of frames"
        if self._sums.sum(axis=0, dtype=np.int64).max(initial=0) > 2**30:
            yield "the array sums has no room for more frames"


def checked_bytes(x: Vector, n_features: int | None = None) -> Vector:
    """Return `x` as an array of integers from 0 to 255, or raise ValueError."""
    array = checked_vector(x, n_features)
    if (
        array.dtype != np.uint8
        and not ((array == np.floor(array)) & (array >= 0) & (array <= 255)).all()
    ):
        raise ValueError("the vector must hold whole numbers from 0 to 255")
    return array
