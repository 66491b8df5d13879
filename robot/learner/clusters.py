"""Base class of the paper's clustering and of `BSOC`: nodes with ids, and edges between nodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.learner.part import Array, Stateful, Value
from robot.learner.values import count
from robot.learner.votes import Distances

if TYPE_CHECKING:
    from robot.learner.bsoc import Edges

MOST_FRAMES = 10**9
"""Upper bound of the number of frames in a model: more than a pilot teaches in three years."""


SHARED: tuple[Value | Array, ...] = (
    Value("max_nodes", count(), "max_nodes", is_fixed=True),
    Value("size", count(), "n_nodes_"),
    Value("next_id", count(), "n_trained_"),
    Array("ids", np.int64, ("n_rows",), attribute="names"),
    Array("pinned", np.bool_, ("n_rows",), attribute="_edges.pinned"),
    Array("counts", np.int64, ("n_rows",), high=MOST_FRAMES),
)
"""The values and arrays that every clustering stores."""


class Clusters(Stateful, ABC):
    """At most `max_nodes` nodes: each is an image averaged over frames, with a permanent id.

    Attributes:
        max_nodes: Maximum number of nodes.
        n_nodes_: Number of nodes.
        n_trained_: Number of frames trained.
        names: The id of each row; a merged node gets the id of its heavier parent.
        last_merge_: The kept and the removed node if two nodes were merged to make room for the
            latest frame, which got the removed node's index. Otherwise None.
        last_distance_: Squared distance of the latest frame from the nearest node, or None if it
            was not measured. The nodes of the previous `HELD_OUT` frames do not count if any other
            node exists.
        last_distances_: Squared distances of the latest frame from the nodes, before any merge.
        last_touched_: The value of `touched_` before the latest frame.
    """

    measures_novelty: ClassVar[bool]

    def __init__(self, max_nodes: int, n_rows: int, edges: type[Edges], dtype: type[Any]) -> None:
        if max_nodes < 1:
            raise ValueError(f"max_nodes must be at least 1, not {max_nodes}")
        self.max_nodes, self.n_rows = max_nodes, n_rows
        self._edges = edges(n_rows, dtype)
        self.last_merge_: tuple[int, int] | None = None
        self.last_distance_: float | None = None
        self.last_distances_: Distances = np.zeros(0, np.float32)
        self.last_touched_ = np.zeros(0, np.int64)
        self.n_nodes_ = self.n_trained_ = 0
        self.names = np.zeros(n_rows, np.int64)
        self._counts = np.zeros(n_rows, np.int64)

    @property
    @abstractmethod
    def kind(self) -> str:
        """Name of the state's format."""

    @property
    @abstractmethod
    def nodes_(self) -> NDArray[Any]:
        """The learned images, shape (n, d)."""

    @property
    def counts_(self) -> NDArray[np.int64]:
        """Frames per node, shape (n,)."""
        return self._counts[: self.n_nodes_].copy()

    @property
    def ids_(self) -> NDArray[np.int64]:
        """Ids of the nodes, shape (n,)."""
        return self.names[: self.n_nodes_].copy()

    @property
    def pinned_(self) -> NDArray[np.bool_]:
        """Whether each node is pinned, shape (n,)."""
        return self._edges.pinned[: self.n_nodes_].copy()

    @property
    def groups_(self) -> NDArray[np.int64]:
        """Group of each node, shape (n,); empty if the clustering has no groups."""
        return np.zeros(0, np.int64)

    @property
    def touched_(self) -> NDArray[np.int64]:
        """Number of the last frame in each node, shape (n,); 0 if the number is not recorded."""
        return np.zeros(self.n_nodes_, np.int64)

    @abstractmethod
    def train(self, x: Vector, group: int = 0) -> int:
        """Add one frame as a node; if there are too many nodes, merge the pair of lowest cost.

        Returns:
            The index of the node that is nearest to `x` after the merge.

        Raises:
            ValueError: If `x` has a new shape or is not finite. Then nothing changes.
        """

    def lookup(self, x: Vector) -> tuple[int, float]:
        """Return the nearest node's index and squared distance; on a tie, the lowest index.

        Raises:
            ValueError: If there is no node yet, or `x` is not a finite vector of the learned
                length; with `integer`, if it is not a vector of bytes.
        """
        distances = self.distances(x)
        nearest = int(distances.argmin())
        return nearest, float(distances[nearest])

    @abstractmethod
    def distances(self, x: Vector) -> Distances:
        """Return the squared distance of `x` to every node, shape (n,); errors as in `lookup`."""

    @abstractmethod
    def _costs(self, node: int) -> Distances:
        """Return the cost of merging one node with each of the nodes, shape (n,); ignores pins."""

    def set_group(self, node: int, group: int) -> None:
        """Move one node to another group."""

    def pin(self, node: int, pinned: bool = True) -> None:
        """Exclude one node from all merges, or include it again.

        Raises:
            ValueError: If so many nodes would be pinned that new frames could not be merged.
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
        """Delete a node. The last node moves to the index `node`; return its old index.

        Raises:
            ValueError: If the node is pinned.
        """
        if self._edges.pinned[node]:
            raise ValueError("a pinned node cannot be deleted; unpin it first")
        last = self.n_nodes_ - 1
        self._move(last, node)
        self.n_nodes_ = last
        return last

    def _move(self, last: int, node: int) -> None:
        """Move the last node to the index of another node."""
        for array in (self._counts, self.names, self._edges.pinned):
            array[node] = array[last]
        self._edges.pinned[last] = False
        self._edges.remove(node, last)

    def restored(self) -> None:
        self.last_merge_ = None
        self._edges.n_pinned = int(self._edges.pinned.sum())
        self._edges.weights[:] = np.inf
        with np.errstate(all="ignore"):  # a loaded model is checked later
            for node in range(min(self.n_nodes_, self.max_nodes)):
                self._edges.set_row(node, self._costs(node))

    def faults(self) -> Iterator[str]:
        """Yield a sentence for each contradiction between the nodes' arrays."""
        size, ids, pinned = self.n_nodes_, self.ids_, self._edges.pinned
        if size > self.max_nodes or size > self.n_trained_:
            yield f"size {size} is above max_nodes or above next_id {self.n_trained_}"
        if len(np.unique(ids)) < size or ids.max(initial=-1) >= self.n_trained_:
            yield "two images have the same id, or an id is above next_id"
        if self.counts_.min(initial=1) < 1:
            yield "an image represents no frame"
        if pinned.sum() > max(self.max_nodes - 1, 0) or pinned[size:].any():
            yield "all images are pinned, or a pinned image does not exist"
