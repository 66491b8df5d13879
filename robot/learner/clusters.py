"""What the paper's clustering and the one that follows from it have in common: named nodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.learner.part import Stateful

Distances = NDArray[np.float32] | NDArray[np.float64]
MOST_FRAMES = 10**9
"""More than a pilot teaches in three years."""


class Merge(NamedTuple):
    """Node `removed` was merged into node `kept`, and its index given to the newest frame.

    A plain tuple, because it is made often and is three times as fast as a dataclass.
    """

    kept: int
    removed: int


class Clusters(Stateful, ABC):
    """At most `max_nodes` nodes: each an image that sums up frames, with a name that lasts.

    Attributes:
        max_nodes: How many nodes to keep at most.
        last_merge_: What the latest `train` merged; None if the frame became a node without a
            merge, or was itself merged into the node that `train` returned.
        last_distance_: Squared distance of the latest frame from the nodes before it, if measured.
    """

    def __init__(self, max_nodes: int, n_rows: int) -> None:
        if max_nodes < 1:
            raise ValueError(f"max_nodes must be at least 1, not {max_nodes}")
        self.max_nodes = max_nodes
        self.last_merge_: Merge | None = None
        self.last_distance_: float | None = None
        self._size = 0
        self._next_id = 0
        self._ids = np.zeros(n_rows, np.int64)
        self._pinned = np.zeros(n_rows, np.bool_)

    def __len__(self) -> int:
        return self._size

    @property
    @abstractmethod
    def nodes_(self) -> NDArray[Any]:
        """Node images, shape (n, d)."""

    @property
    @abstractmethod
    def counts_(self) -> NDArray[np.int64]:
        """Frames per node, shape (n,)."""

    @property
    def ids_(self) -> NDArray[np.int64]:
        """Names of the nodes, shape (n,): a merged node keeps that of its heavier parent."""
        return self._ids[: self._size].copy()

    @property
    def pinned_(self) -> NDArray[np.bool_]:
        """Which nodes are pinned, shape (n,)."""
        return self._pinned[: self._size].copy()

    def node_id(self, index: int) -> int:
        """Return the name of one node."""
        return int(self._ids[index])

    def lookup(self, x: Vector) -> tuple[int, float]:
        """Return the nearest node's index and its squared distance; the lowest index on a tie.

        Raises:
            ValueError: If there is no node yet, or `x` is no finite vector of that length (or
                not of bytes, with `integer`).
        """
        distances = self.distances(x)
        nearest = int(distances.argmin())
        return nearest, float(distances[nearest])

    @abstractmethod
    def distances(self, x: Vector) -> Distances:
        """Return the squared distance of `x` to every node, shape (n,); raises as `lookup`."""

    def restored(self) -> None:
        """Begin without a latest merge."""
        self.last_merge_ = None

    def faults(self) -> Iterator[str]:
        """Yield what the nodes say of one another that cannot be."""
        size, ids = self._size, self.ids_
        if size > self.max_nodes or size > self._next_id:
            yield f"size is {size}, and next_id {self._next_id}"
        if len(np.unique(ids)) < size or ids.max(initial=-1) >= self._next_id:
            yield "two images have one id, or an id is above next_id"
        if self.counts_.min(initial=1) < 1:
            yield "an image stands for no frame"
        if self._pinned.sum() > max(self.max_nodes - 1, 0) or self._pinned[size:].any():
            yield "all images are pinned, or one that is none"
        with np.errstate(all="ignore"):
            if not self._fits():
                yield "the distances do not fit the images"

    @abstractmethod
    def _fits(self) -> bool:
        """Tell whether distances and weights are about those that the images have."""
