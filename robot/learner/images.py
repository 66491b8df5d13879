"""The pixels of the nodes: their distances and means, in float32."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector, checked_vector
from robot.learner.part import MOST_DISTANCE, MOST_VALUES, Array, Stateful, Value

Floats = NDArray[np.float32]
MOST_NORM = 1e24
"""Upper bound of a squared norm, so that the most expensive merge has a finite cost in float32."""


class Images(Stateful):
    """Stores the nodes' images in rows, and compares one frame `x` at a time with them.

    Images are stored relative to the first frame. Products of raw bytes in float32 would lose the
    small differences between near-duplicates.
    """

    fields: Sequence[Value | Array] = (
        Array(
            "images", np.float32, ("max_nodes", "d"), -2.0 * MOST_VALUES, 2.0 * MOST_VALUES, "_rows"
        ),
        Array("norms", np.float32, ("max_nodes",), high=MOST_DISTANCE),
        Array("origin", np.float32, ("d",), -MOST_VALUES, MOST_VALUES),
    )

    def __init__(self, max_nodes: int) -> None:
        self.max_nodes = max_nodes
        self._rows: NDArray[Any] = np.zeros((max_nodes, 0), np.float32)
        self._norms: NDArray[Any] = np.zeros(max_nodes, np.float32)
        self._x: NDArray[Any] = np.zeros(0, np.float32)
        self._x_norm = 0.0
        self._set_origin(np.zeros(0, np.float32))

    def begin(self, x: Vector) -> None:
        """Set the length and the origin from the first vector."""
        origin = checked_vector(x).astype(np.float32)
        if not 0.5 * float(origin.dot(origin)) < MOST_NORM:
            raise ValueError("the vector holds values that are too large")
        self._set_origin(origin)
        self._rows = np.zeros((self.max_nodes, origin.size), np.float32)

    def _set_origin(self, origin: Floats) -> None:
        self._origin, self._step = origin, np.zeros_like(origin)
        self._shape = origin.shape

    def measure(self, x: Vector, size: int) -> Floats:
        """Return |n|^2 / 2 - n.x + |x|^2 / 2 for each image, shape (size,)."""
        array = np.asarray(x)
        if array.shape != self._shape or array.dtype.kind not in "fiub":
            checked_vector(array, self._origin.size)
        # Create a new array for each call, because several threads may call this at the same time.
        centred = np.asarray(array, np.float32) - self._origin
        norm = 0.5 * float(centred.dot(centred))
        if not norm < MOST_NORM:
            raise ValueError("the vector holds values that are not finite, or too large")
        self._x, self._x_norm = centred, norm
        is_full = size == self.max_nodes
        distances: Floats = (self._rows if is_full else self._rows[:size]).dot(centred)
        np.subtract(self._norms if is_full else self._norms[:size], distances, out=distances)
        distances += norm
        # Rounding errors may make the distance of a near-duplicate negative.
        if size and distances[distances.argmin()] < 0.0:
            np.maximum(distances, 0.0, out=distances)
        return distances

    def put(self, row: int) -> None:
        """Store the measured vector as the image of a row."""
        self._rows[row] = self._x
        self._norms[row] = self._x_norm

    def absorb(self, row: int, count: int) -> None:
        """Make the image of `count` frames the mean of these frames and the measured vector."""
        self._blend(row, self._x, 1.0 / (count + 1))

    def merge(self, kept: int, removed: int, count_kept: int, count_removed: int) -> None:
        """Merge one image into another; the measured vector gets the removed image's row."""
        self._blend(kept, self._rows[removed], count_removed / (count_kept + count_removed))
        self.put(removed)

    def _blend(self, row: int, other: NDArray[np.float32], share: float) -> None:
        image, step = self._rows[row], self._step
        np.subtract(other, image, out=step)
        np.multiply(step, share, out=step)
        image += step
        self._norms[row] = 0.5 * image.dot(image)

    def move(self, source: int, target: int) -> None:
        """Copy one image over another."""
        self._rows[target] = self._rows[source]
        self._norms[target] = self._norms[source]

    def nodes(self, size: int) -> NDArray[np.float32]:
        """Return the images in the scale of the learned vectors, shape (size, d)."""
        images: NDArray[np.float32] = self._rows[:size] + self._origin
        return images

    def compared(self, size: int) -> Floats:
        """Return the compared values of each image, relative to a constant vector."""
        return self._rows[:size]

    def follow(self, counts: NDArray[np.int64]) -> None:
        """Recompute the values that depend on the number of frames per image, if there are any."""

    def faults(self) -> Iterator[str]:
        norms = 0.5 * np.einsum("ij,ij->i", self._rows, self._rows)
        if not np.allclose(self._norms, norms, rtol=1e-3, atol=0.1):
            yield "the array norms does not match the images"

    def restored(self) -> None:
        self._set_origin(self._origin)
