"""What the paper's clustering and the one after it have in common: named nodes, and edges."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.learner.part import Arrays, Params, Stateful

Distances = NDArray[np.float32] | NDArray[np.float64]

CACHED_FROM = 200
"""Nodes from which on each row's least is kept. Below, one argmin over all weights is faster:
2 us against 9 at 128 nodes, 340 us against 25 at 1024."""


class Edges:
    """A symmetric matrix of weights; infinite where there is no edge."""

    def __init__(self, n: int, dtype: type[Any]) -> None:
        self.weights = np.full((n, n), np.inf, dtype)
        self._n = n
        self._is_cached = n >= CACHED_FROM
        self._least = np.full(n, np.inf, dtype)
        self._partner = np.zeros(n, np.int64)

    def smallest(self) -> tuple[float, int, int]:
        """Return weight and ends of the smallest edge; the lowest indices on a tie."""
        if self._is_cached:
            one = int(self._least.argmin())
            return float(self._least[one]), one, int(self._partner[one])
        one, two = divmod(int(self.weights.argmin()), self._n)
        return float(self.weights[one, two]), one, two

    def set_row(self, node: int, weights: Distances) -> None:
        """Write one node's weights to the first `len(weights)` nodes."""
        weights[node] = np.inf
        size = weights.size
        self.weights[node, :size] = weights
        self.weights[:size, node] = weights
        if self._is_cached:
            self._update(node, weights)

    def remove(self, node: int, last: int) -> None:
        """Let the last node take the place of `node`."""
        row = self.weights[last, :last].copy()
        self.weights[last, :] = self.weights[:, last] = np.inf
        if node != last:
            self.weights[node, :last] = self.weights[:last, node] = row
            self.weights[node, node] = np.inf
        if self._is_cached:
            self._partner = self.weights.argmin(axis=1)
            self._least = self.weights[np.arange(self._n), self._partner]

    def _update(self, node: int, weights: Distances) -> None:
        """Update each row's smallest weight after one node's weights changed."""
        size = weights.size
        least, partner = self._least[:size], self._partner[:size]
        lost = np.flatnonzero(partner == node)
        better = (weights < least) | ((weights == least) & (node < partner))
        least[better] = weights[better]
        partner[better] = node
        for row in lost.tolist():
            self._rescan(row)
        self._rescan(node)

    def _rescan(self, row: int) -> None:
        best = int(self.weights[row].argmin())
        self._partner[row] = best
        self._least[row] = self.weights[row, best]


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
        n_nodes_: How many there are.
        last_merge_: What the latest `train` merged; None if the frame became a node without a
            merge, or was itself merged into the node that `train` returned.
        last_distance_: Squared distance of the latest frame from the nodes before it, if measured.
    """

    def __init__(self, max_nodes: int, n_rows: int, dtype: type[Any]) -> None:
        if max_nodes < 1:
            raise ValueError(f"max_nodes must be at least 1, not {max_nodes}")
        self.max_nodes = max_nodes
        self.last_merge_: Merge | None = None
        self.last_distance_: float | None = None
        self.n_nodes_ = 0
        self._next_id = 0
        self._ids = np.zeros(n_rows, np.int64)
        self._pinned = np.zeros(n_rows, np.bool_)
        self._n_pinned = 0
        self._edges = Edges(n_rows, dtype)

    def __len__(self) -> int:
        return self.n_nodes_

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
        return self._ids[: self.n_nodes_].copy()

    @property
    def pinned_(self) -> NDArray[np.bool_]:
        """Which nodes are pinned, shape (n,)."""
        return self._pinned[: self.n_nodes_].copy()

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

    @abstractmethod
    def _costs(self, node: int) -> Distances:
        """Return what merging a node with each of all nodes costs, without pins, shape (n,)."""

    def _weigh(self, node: int) -> None:
        """Write what merging a node costs: infinitely much for a pinned one."""
        weights = self._costs(node)
        if self._n_pinned:
            weights[self._pinned[: weights.size] | self._pinned[node]] = np.inf
        self._edges.set_row(node, weights)

    def pin(self, node: int, pinned: bool = True) -> None:
        """Keep one node out of all merges, or let it take part again.

        Raises:
            ValueError: If no node would be left for new frames to merge with.
        """
        others = self._n_pinned - bool(self._pinned[node])
        if pinned and others >= self.max_nodes - 1:
            raise ValueError(
                f"at most {self.max_nodes - 1} of {self.max_nodes} nodes can be pinned"
            )
        self._pinned[node] = pinned
        self._n_pinned = others + pinned
        self._weigh(node)

    def delete(self, node: int) -> int:
        """Forget one node and return the index of the last, which takes its place.

        Raises:
            ValueError: If it is pinned.
        """
        if self._pinned[node]:
            raise ValueError("a pinned node cannot be deleted; unpin it first")
        last = self.n_nodes_ - 1
        self._move(last, node)
        self.n_nodes_ = last
        return last

    @abstractmethod
    def _move(self, last: int, node: int) -> None:
        """Let the last node take the place of another."""

    def upgrade(self, params: Params, arrays: Arrays) -> None:
        """Leave out the weights, which follow from the rest."""
        arrays.pop("weights", None)

    def restored(self) -> None:
        self.last_merge_ = None
        self._n_pinned = int(self._pinned.sum())
        self._edges.weights[:] = np.inf
        with np.errstate(all="ignore"):  # of a model that is still to be checked
            for node in range(min(self.n_nodes_, self.max_nodes)):
                self._weigh(node)

    def faults(self) -> Iterator[str]:
        """Yield what the nodes say of one another that cannot be."""
        size, ids = self.n_nodes_, self.ids_
        if size > self.max_nodes or size > self._next_id:
            yield f"size is {size}, and next_id {self._next_id}"
        if len(np.unique(ids)) < size or ids.max(initial=-1) >= self._next_id:
            yield "two images have one id, or an id is above next_id"
        if self.counts_.min(initial=1) < 1:
            yield "an image stands for no frame"
        if self._pinned.sum() > max(self.max_nodes - 1, 0) or self._pinned[size:].any():
            yield "all images are pinned, or one that is none"
