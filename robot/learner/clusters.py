"""The base of the paper's clustering and of `BSOC`: named nodes, and edges between them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.learner.part import Array, Stateful, Value
from robot.learner.values import count
from robot.learner.votes import Distances

CACHED_FROM = 200
"""Nodes from which on each row's least is kept. Below, one argmin over all weights is faster:
2 us against 9 at 128 nodes, 340 us against 25 at 1024."""


class Edges:
    """A symmetric matrix of weights; infinite where there is no edge, and to a pinned node."""

    def __init__(self, n: int, dtype: type[Any]) -> None:
        self.weights = np.full((n, n), np.inf, dtype)
        self.pinned = np.zeros(n, np.bool_)
        self.n_pinned = 0
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
        if self.n_pinned:
            weights[self.pinned[:size] | self.pinned[node]] = np.inf
        self.weights[node, :size] = weights
        self.weights[:size, node] = weights
        if self._is_cached:
            changed = self._partner == node
            changed[:size] |= weights <= self._least[:size]
            changed[node] = True
            self._rescan(np.flatnonzero(changed))

    def remove(self, node: int, last: int) -> None:
        """Let the last node take the place of `node`."""
        row = self.weights[last, :last].copy()
        self.weights[last, :] = self.weights[:, last] = np.inf
        if node != last:
            self.weights[node, :last] = self.weights[:last, node] = row
            self.weights[node, node] = np.inf
        if self._is_cached:
            self._rescan(np.arange(self._n))

    def _rescan(self, rows: NDArray[np.intp]) -> None:
        """Find the smallest weight of each of these rows."""
        self._partner[rows] = partners = self.weights[rows].argmin(axis=1)
        self._least[rows] = self.weights[rows, partners]


MOST_FRAMES = 10**9
"""Upper bound of the frames in a model: more than a pilot teaches in three years."""


SHARED: tuple[Value | Array, ...] = (
    Value("max_nodes", count(), "max_nodes", is_fixed=True),
    Value("size", count(), "n_nodes_"),
    Value("next_id", count(), "n_trained_"),
    Array("ids", np.int64, ("n_rows",), attribute="names"),
    Array("pinned", np.bool_, ("n_rows",), attribute="_edges.pinned"),
    Array("counts", np.int64, ("n_rows",), high=MOST_FRAMES),
)
"""The values and arrays that every clustering keeps."""


class Clusters(Stateful, ABC):
    """At most `max_nodes` nodes: each an image that sums up frames, with a name that lasts.

    Attributes:
        max_nodes: How many nodes to keep at most.
        n_nodes_: How many there are.
        n_trained_: How many frames there were.
        names: Of each row: a merged node keeps that of its heavier parent.
        last_merge_: Into which node the latest `train` merged which other, whose index the newest
            frame got; None if the frame became a node without a merge, or was itself merged into
            the node that `train` returned.
        last_distance_: Squared distance of the latest frame from the nearest node before it that
            none of the `HELD_OUT` frames before it went into (of all, if there is no such node);
            None for the first frames, and if it is not measured.
        last_distances_: Squared distances of the latest frame from the nodes before any merge.
        last_touched_: When each node had got a frame then.
    """

    measures_novelty: ClassVar[bool]

    def __init__(self, max_nodes: int, n_rows: int, dtype: type[Any]) -> None:
        if max_nodes < 1:
            raise ValueError(f"max_nodes must be at least 1, not {max_nodes}")
        self.max_nodes, self.n_rows = max_nodes, n_rows
        self.last_merge_: tuple[int, int] | None = None
        self.last_distance_: float | None = None
        self.last_distances_: Distances = np.zeros(0, np.float32)
        self.last_touched_ = np.zeros(0, np.int64)
        self.n_nodes_ = self.n_trained_ = 0
        self.names = np.zeros(n_rows, np.int64)
        self._counts = np.zeros(n_rows, np.int64)
        self._edges = Edges(n_rows, dtype)

    def __len__(self) -> int:
        return self.n_nodes_

    @property
    @abstractmethod
    def kind(self) -> str:
        """Name of the format of its state."""

    @property
    @abstractmethod
    def nodes_(self) -> NDArray[Any]:
        """Node images, shape (n, d)."""

    @property
    def counts_(self) -> NDArray[np.int64]:
        """Frames per node, shape (n,)."""
        return self._counts[: self.n_nodes_].copy()

    @property
    def ids_(self) -> NDArray[np.int64]:
        """Names of the nodes, shape (n,)."""
        return self.names[: self.n_nodes_].copy()

    @property
    def pinned_(self) -> NDArray[np.bool_]:
        """Which nodes are pinned, shape (n,)."""
        return self._edges.pinned[: self.n_nodes_].copy()

    @property
    def groups_(self) -> NDArray[np.int64]:
        """Group of each node, shape (n,); of no node, where there are no groups."""
        return np.zeros(0, np.int64)

    @property
    def touched_(self) -> NDArray[np.int64]:
        """When each node last got a frame, as a count of frames, shape (n,), if it is measured."""
        return np.zeros(self.n_nodes_, np.int64)

    @abstractmethod
    def train(self, x: Vector, group: int = 0) -> int:
        """Add one frame; merge the two nodes cheapest to merge if there are too many.

        Returns:
            The index of the node nearest to `x` afterwards.

        Raises:
            ValueError: If `x` is of another shape than before or not finite; nothing changes.
        """

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

    def set_group(self, node: int, group: int) -> None:
        """Move one node to another group."""

    def pin(self, node: int, pinned: bool = True) -> None:
        """Keep one node out of all merges, or let it take part again.

        Raises:
            ValueError: If no node would be left for new frames to merge with.
        """
        edges = self._edges
        others = edges.n_pinned - bool(edges.pinned[node])
        if pinned and others >= self.max_nodes - 1:
            raise ValueError(
                f"at most {self.max_nodes - 1} of {self.max_nodes} nodes can be pinned"
            )
        edges.pinned[node], edges.n_pinned = pinned, others + pinned
        edges.set_row(node, self._costs(node))

    def delete(self, node: int) -> int:
        """Forget one node and return the index of the last, which takes its place.

        Raises:
            ValueError: If it is pinned.
        """
        if self._edges.pinned[node]:
            raise ValueError("a pinned node cannot be deleted; unpin it first")
        last = self.n_nodes_ - 1
        self._move(last, node)
        self.n_nodes_ = last
        return last

    def _move(self, last: int, node: int) -> None:
        """Let the last node take the place of another."""
        for array in (self._counts, self.names, self._edges.pinned):
            array[node] = array[last]
        self._edges.pinned[last] = False
        self._edges.remove(node, last)

    def restored(self) -> None:
        self.last_merge_ = None
        self._edges.n_pinned = int(self._edges.pinned.sum())
        self._edges.weights[:] = np.inf
        with np.errstate(all="ignore"):  # of a model that is still to be checked
            for node in range(min(self.n_nodes_, self.max_nodes)):
                self._edges.set_row(node, self._costs(node))

    def faults(self) -> Iterator[str]:
        """Yield what the nodes say of one another that cannot be."""
        size, ids, pinned = self.n_nodes_, self.ids_, self._edges.pinned
        if size > self.max_nodes or size > self.n_trained_:
            yield f"size is {size}, and next_id {self.n_trained_}"
        if len(np.unique(ids)) < size or ids.max(initial=-1) >= self.n_trained_:
            yield "two images have one id, or an id is above next_id"
        if self.counts_.min(initial=1) < 1:
            yield "an image stands for no frame"
        if pinned.sum() > max(self.max_nodes - 1, 0) or pinned[size:].any():
            yield "all images are pinned, or one that is none"
