"""The clustering exactly as published, with the published rules for ties.

Source: Ferrer, FLAIRS-30 (2017), and for details that are not in the paper, the authors' program.
The distance is the sum of squared differences. A new node gets the lowest free index. A merged node
gets the lower index of the two nodes, and the last node moves to the other index.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector, checked_vector
from robot.learner.bsoc import MOST_NORM, Edges
from robot.learner.clusters import SHARED, Clusters
from robot.learner.integer_images import checked_bytes
from robot.learner.part import MOST_VALUES, Array, Value


class PublishedBSOC(Clusters):
    """`BSOC` as published, without groups. Each step passes over all nodes twice: once for the new
    vector, and once for the merged node.

    With `integer`, vectors and images are stored as bytes, and pixels need no floating-point
    operations. A merged image is rounded to the nearest integer, as in the authors' program.
    Without `integer`, images are exact means. Pinning is not in the paper; the page needs it.
    """

    measures_novelty = False

    def __init__(self, max_nodes: int, *, integer: bool = False) -> None:
        super().__init__(max_nodes, max_nodes + 1, Edges, np.float64)
        self.integer = integer
        self._dtype: type[Any] = np.int32 if integer else np.float64
        # The sums of many frames need 64 bits.
        self._wide: type[Any] = np.int64 if integer else np.float64
        self._images: NDArray[Any] = np.zeros((self.n_rows, 0), self._dtype)

    @property
    def fields(self) -> Sequence[Value | Array]:
        """The values and arrays. The images are bytes if `integer` is set, else exact means."""
        least, most = (0.0, 255.0) if self.integer else (-MOST_VALUES, MOST_VALUES)
        return (*SHARED, Array("images", self._dtype, ("n_rows", "d"), least, most))

    @property
    def nodes_(self) -> NDArray[Any]:
        """The image of each node, shape (n, d), as uint8 if `integer` is set, else as float64."""
        images = self._images[: self.n_nodes_]
        return images.astype(np.uint8) if self.integer else images.copy()

    def distances(self, x: Vector) -> NDArray[np.float64]:
        if self.n_nodes_ == 0:
            raise ValueError("nothing was learned yet")
        return self._measure(self._checked(x))

    def train(self, x: Vector, group: int = 0) -> int:
        image = self._checked(x)
        if self.n_nodes_ == 0:
            self._images = np.zeros((self.n_rows, image.size), self._dtype)
        self.n_nodes_ += 1
        self._insert(self.n_nodes_ - 1, image, 1, self.n_trained_)
        self.n_trained_ += 1
        self.last_merge_ = None
        if self.n_nodes_ > self.max_nodes:
            self._merge_closest()
        return int(self._measure(image).argmin())

    def _checked(self, x: Vector) -> NDArray[Any]:
        check = checked_bytes if self.integer else checked_vector
        image = check(x, self._images.shape[1] or None).astype(self._dtype)
        if not 0.5 * float(image.dot(image)) < MOST_NORM:
            raise ValueError("the vector holds values that are too large")
        return image

    def _measure(self, image: NDArray[Any]) -> NDArray[np.float64]:
        """Return squared distances, shape (n,)."""
        differences = self._images[: self.n_nodes_] - image
        dtype = None if image.size * 255 * 255 < 2**31 else self._wide  # int32 would overflow
        distances: NDArray[Any] = np.einsum("ij,ij->i", differences, differences, dtype=dtype)
        return distances.astype(np.float64)

    def _insert(self, index: int, image: NDArray[Any], count: int, name: int) -> None:
        self._images[index] = image
        self._counts[index] = count
        self.names[index] = name
        self._edges.set_row(index, self._costs(index))

    def _costs(self, node: int) -> NDArray[np.float64]:
        masses = np.maximum(self._counts[: self.n_nodes_], self._counts[node])
        costs: NDArray[np.float64] = self._measure(self._images[node]) * masses
        return costs

    def _merge_closest(self) -> None:
        _, kept, removed = self._edges.smallest()
        n_kept, n_removed = int(self._counts[kept]), int(self._counts[removed])
        total = n_kept + n_removed
        sums = n_kept * self._images[kept].astype(self._wide) + n_removed * self._images[removed]
        merged = (2 * sums + total) // (2 * total) if self.integer else sums / total
        name = int(self.names[kept if n_kept >= n_removed else removed])
        self.n_nodes_ -= 1
        self._move(self.n_nodes_, removed)
        self._insert(kept, merged, total, name)
        if removed != self.n_nodes_:
            self.last_merge_ = kept, removed

    def _move(self, last: int, node: int) -> None:
        self._images[node] = self._images[last]
        super()._move(last, node)

    @property
    def kind(self) -> str:
        return "published-integer" if self.integer else "published"
