"""Bounded Self-Organizing Clusters: at most `max_nodes` images that sum up all that was seen.

Source: Ferrer, "Bounded Self-Organizing Clusters", FLAIRS-30 (2017). The paper compares images
pixel by pixel after every merge; here a merged node's distances follow from those already known
(Lance and Williams 1967, centroid linkage), so that a training step is one pass over the nodes.
`robot.learner.published` is the paper to the letter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import State, Vector, checked_vector

Floats = NDArray[np.float64]
_ARRAYS = ("images", "norms", "counts", "ids", "groups", "pinned", "distances", "weights")


@dataclass(frozen=True, slots=True, kw_only=True)
class Merge:
    """What one training step did to the node indices: follow it to keep data beside the nodes.

    Node `removed` was merged into node `kept`, then the node `moved` took the index `removed`
    (`moved` equals `removed` if the merged one was the last).
    """

    kept: int
    removed: int
    moved: int


class BSOC:
    """An online clustering of bounded size.

    Args:
        max_nodes: How many nodes to keep at most; the only parameter of the algorithm.
        group_cost: How many times dearer it is to merge nodes of two groups (labels, say).
            1 is the paper, which knows no groups.

    Attributes:
        nodes_: Node images, shape (n, d), float32.
        counts_: How many frames each node sums up, shape (n,), int64.
        ids_: A name for each node that survives: a merged node keeps that of its heavier parent.
        last_merge_: The latest merge, or None if the latest `train` needed none.
    """

    def __init__(self, max_nodes: int, *, group_cost: float = 1.0) -> None:
        if max_nodes < 1:
            raise ValueError(f"max_nodes must be at least 1, not {max_nodes}")
        if group_cost < 1.0:
            raise ValueError(f"group_cost must be at least 1, not {group_cost}")
        self.max_nodes = max_nodes
        self.group_cost = group_cost
        self.last_merge_: Merge | None = None
        self._size = 0
        self._next_id = 0
        self._counts = np.zeros(max_nodes + 1, np.int64)
        self._ids = np.zeros(max_nodes + 1, np.int64)
        self._groups = np.zeros(max_nodes + 1, np.int64)
        self._pinned = np.zeros(max_nodes + 1, np.bool_)
        self._distances = np.zeros((max_nodes + 1, max_nodes + 1))
        self._weights = np.full((max_nodes + 1, max_nodes + 1), np.inf)
        self._norms = np.zeros(max_nodes + 1)
        # Images are kept relative to the first frame: float32 products of raw bytes lose the
        # small differences between near-duplicates.
        self._origin: NDArray[np.float32] | None = None
        self._images = np.zeros((max_nodes + 1, 0), np.float32)

    def __len__(self) -> int:
        return self._size

    @property
    def nodes_(self) -> NDArray[np.float32]:
        """Node images, shape (n, d)."""
        if self._origin is None:
            return np.zeros((0, 0), np.float32)
        return self._images[: self._size] + self._origin

    @property
    def counts_(self) -> NDArray[np.int64]:
        """Frames per node, shape (n,)."""
        return self._counts[: self._size].copy()

    @property
    def ids_(self) -> NDArray[np.int64]:
        """Names of the nodes, shape (n,)."""
        return self._ids[: self._size].copy()

    @property
    def groups_(self) -> NDArray[np.int64]:
        """Group of each node, shape (n,)."""
        return self._groups[: self._size].copy()

    def node_id(self, index: int) -> int:
        """Return the name of one node."""
        return int(self._ids[index])

    def lookup(self, x: Vector) -> tuple[int, float]:
        """Return the nearest node's index and its squared distance; the lowest index on a tie.

        Raises:
            ValueError: If there is no node yet, or `x` is of another shape or not finite.
        """
        distances = self.distances(x)
        nearest = int(distances.argmin())
        return nearest, float(distances[nearest])

    def distances(self, x: Vector) -> Floats:
        """Return the squared distance of `x` to every node, shape (n,); raises as `lookup`."""
        if self._origin is None or self._size == 0:
            raise ValueError("nothing was learned yet")
        return self._measure(self._centred(x))[0]

    def train(self, x: Vector, group: int = 0) -> int:
        """Add one frame, merge the two nodes cheapest to merge if there are too many.

        Time O(max_nodes * d + max_nodes ** 2), whatever the number of frames seen.

        Returns:
            The index of the node nearest to `x` afterwards.

        Raises:
            ValueError: If `x` is of another shape than before or not finite; nothing changes.
        """
        if self._origin is None:
            self._begin(x)
        centred = self._centred(x)
        distances, norm = self._measure(centred)
        size = self._size
        self._append(centred, norm, distances, group)
        if size < self.max_nodes:
            self.last_merge_ = None
            return int(self._distances[size, : size + 1].argmin())
        return self._merge_closest()

    def set_group(self, node: int, group: int) -> None:
        """Move one node to another group."""
        self._groups[node] = group
        self._set_row(node, self._distances[node, : self._size].copy(), self._size)

    def pin(self, node: int, pinned: bool = True) -> None:
        """Keep one node out of all merges, or let it take part again.

        Raises:
            ValueError: If no two nodes would be left that can be merged.
        """
        if pinned and not self._pinned[node] and self._pinned.sum() >= self.max_nodes - 1:
            raise ValueError(
                f"at most {self.max_nodes - 1} of {self.max_nodes} nodes can be pinned"
            )
        self._pinned[node] = pinned
        self._set_row(node, self._distances[node, : self._size].copy(), self._size)

    @property
    def pinned_(self) -> NDArray[np.bool_]:
        """Which nodes are pinned, shape (n,)."""
        return self._pinned[: self._size].copy()

    def delete(self, node: int) -> Merge:
        """Forget one node; the last takes its index.

        Raises:
            ValueError: If it is pinned.
        """
        if self._pinned[node]:
            raise ValueError("a pinned node cannot be deleted; unpin it first")
        last = self._size - 1
        self._remove(node)
        return Merge(kept=node, removed=node, moved=last)

    def get_state(self) -> State:
        """Return a copy of all that was learned."""
        arrays = {name: getattr(self, f"_{name}").copy() for name in _ARRAYS}
        if self._origin is not None:
            arrays["origin"] = self._origin.copy()
        params = {
            "max_nodes": self.max_nodes,
            "group_cost": self.group_cost,
            "size": self._size,
            "next_id": self._next_id,
        }
        return State(kind="bsoc", params=params, arrays=arrays)

    def set_state(self, state: State) -> None:
        """Become the clustering that gave `state`; raises ValueError if of another kind."""
        if state.kind != "bsoc":
            raise ValueError(f"the model is a {state.kind}, not a bsoc")
        self.max_nodes = int(state.params["max_nodes"])
        self.group_cost = float(state.params["group_cost"])
        self._size = int(state.params["size"])
        self._next_id = int(state.params["next_id"])
        for name in _ARRAYS:
            setattr(self, f"_{name}", state.arrays[name].copy())
        origin = state.arrays.get("origin")
        self._origin = None if origin is None else origin.copy()
        self.last_merge_ = None

    def _begin(self, x: Vector) -> None:
        origin = checked_vector(x).astype(np.float32)
        if not np.isfinite(origin).all():
            raise ValueError("the vector holds values that are not finite")
        self._origin = origin
        self._images = np.zeros((self.max_nodes + 1, origin.size), np.float32)

    def _centred(self, x: Vector) -> NDArray[np.float32]:
        assert self._origin is not None
        array = np.asarray(x)
        if array.shape != self._origin.shape:
            raise ValueError(
                f"the vector's shape is {array.shape}, learned was {self._origin.shape}"
            )
        centred: NDArray[np.float32] = np.subtract(
            array, self._origin, dtype=np.float32, casting="unsafe"
        )
        return centred

    def _measure(self, centred: NDArray[np.float32]) -> tuple[Floats, float]:
        """Squared distances to all nodes, by |n|^2 - 2 n.x + |x|^2, and |x|^2."""
        norm = float(centred @ centred)
        if not norm < np.inf:
            raise ValueError("the vector holds values that are not finite")
        distances = self._norms[: self._size] - 2.0 * (self._images[: self._size] @ centred)
        distances += norm
        np.maximum(distances, 0.0, out=distances)
        return distances, norm

    def _append(
        self, centred: NDArray[np.float32], norm: float, distances: Floats, group: int
    ) -> None:
        new = self._size
        self._images[new] = centred
        self._norms[new] = norm
        self._counts[new] = 1
        self._groups[new] = group
        self._pinned[new] = False
        self._ids[new] = self._next_id
        self._next_id += 1
        self._size = new + 1
        self._set_row(new, distances, new)

    def _set_row(self, node: int, distances: Floats, size: int) -> None:
        """Write one node's distances to the first `size` nodes, and the weights that follow."""
        weights = distances * np.maximum(self._counts[:size], self._counts[node])
        if self.group_cost != 1.0:
            weights[self._groups[:size] != self._groups[node]] *= self.group_cost
        if self._pinned.any():
            weights[self._pinned[:size] | self._pinned[node]] = np.inf
        self._distances[node, :size] = distances
        self._distances[:size, node] = distances
        self._distances[node, node] = 0.0
        self._weights[node, :size] = weights
        self._weights[:size, node] = weights
        self._weights[node, node] = np.inf

    def _merge_closest(self) -> int:
        """Merge the pair of least weight and return the node then nearest to the newest, x."""
        kept, removed = self._closest_pair()
        share_removed = self._counts[removed] / (self._counts[kept] + self._counts[removed])
        row = self._merged_row(kept, removed, share_removed)
        image = self._images[kept]
        image += (self._images[removed] - image) * np.float32(share_removed)
        self._norms[kept] = float(image @ image)
        if self._counts[removed] > self._counts[kept]:
            self._ids[kept] = self._ids[removed]
            self._groups[kept] = self._groups[removed]
        self._counts[kept] += self._counts[removed]
        self._set_row(kept, row, self._size)
        newest = self._size - 1
        from_x = self._distances[newest, :newest].copy()
        self._remove(removed)
        self.last_merge_ = Merge(kept=kept, removed=removed, moved=newest)
        if removed != newest:  # x is a node of its own, and has moved to the free index
            from_x[removed] = 0.0
        return int(from_x.argmin())

    def _closest_pair(self) -> tuple[int, int]:
        """Indices of the edge of least weight, the lowest on a tie; a pinned node has none."""
        return divmod(int(self._weights.argmin()), self.max_nodes + 1)

    def _merged_row(self, kept: int, removed: int, share: float) -> Floats:
        """Lance-Williams: d(k, ij) = wi d(k, i) + wj d(k, j) - wi wj d(i, j)."""
        row = (1.0 - share) * self._distances[kept, : self._size]
        row += share * self._distances[removed, : self._size]
        row -= (1.0 - share) * share * self._distances[kept, removed]
        np.maximum(row, 0.0, out=row)
        return row

    def _remove(self, node: int) -> None:
        """Drop a node; the last one takes its index, so that indices stay without gaps."""
        last = self._size - 1
        if node != last:
            self._images[node] = self._images[last]
            for array in (self._norms, self._counts, self._ids, self._groups, self._pinned):
                array[node] = array[last]
            for matrix, own in ((self._distances, 0.0), (self._weights, np.inf)):
                matrix[node, :last] = matrix[last, :last]
                matrix[:last, node] = matrix[last, :last]
                matrix[node, node] = own
        self._weights[last, :] = np.inf
        self._weights[:, last] = np.inf
        self._pinned[last] = False
        self._size = last
