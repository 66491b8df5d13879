"""The paper's clustering to the letter: byte images, exact whole-number distances, its ties.

Source: Ferrer, FLAIRS-30 (2017), with the details of the authors' program: the distance is the
sum of squared differences; images are bytes, rounded to nearest on a merge; a new node takes the
lowest free index, a merged one the lower of its two, and the last node fills the gap.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import State, Vector
from robot.learner.bsoc import Merge
from robot.learner.images import checked_bytes

Integers = NDArray[np.int64]
_ARRAYS = ("images", "norms", "counts", "ids", "pinned", "weights")
_NEVER = np.iinfo(np.int64).max


class PublishedBSOC:
    """`BSOC` as published; two passes over the nodes a step, one for x, one for a merged node.

    Vectors are whole numbers from 0 to 255. With `integer`, pixels are compared in int32 (for
    machines without a floating-point unit), else in float64, which is exact for bytes too and
    runs on fast matrix products: both give the same nodes to the bit.
    """

    def __init__(self, max_nodes: int, *, integer: bool = False) -> None:
        if max_nodes < 1:
            raise ValueError(f"max_nodes must be at least 1, not {max_nodes}")
        self.max_nodes = max_nodes
        self.integer = integer
        self.last_merge_: Merge | None = None
        self._size = 0
        self._next_id = 0
        self._dtype = np.int32 if integer else np.float64
        self._images = np.zeros((max_nodes + 1, 0), self._dtype)
        self._norms = np.zeros(max_nodes + 1, np.int64)
        self._counts = np.zeros(max_nodes + 1, np.int64)
        self._ids = np.zeros(max_nodes + 1, np.int64)
        self._pinned = np.zeros(max_nodes + 1, np.bool_)
        self._weights = np.full((max_nodes + 1, max_nodes + 1), _NEVER)

    def __len__(self) -> int:
        return self._size

    @property
    def nodes_(self) -> NDArray[np.uint8]:
        """Node images, shape (n, d)."""
        return self._images[: self._size].astype(np.uint8)

    @property
    def counts_(self) -> Integers:
        """Frames per node, shape (n,)."""
        return self._counts[: self._size].copy()

    @property
    def ids_(self) -> Integers:
        """Names of the nodes, shape (n,): a merged node keeps that of its heavier parent."""
        return self._ids[: self._size].copy()

    def node_id(self, index: int) -> int:
        """Return the name of one node."""
        return int(self._ids[index])

    def lookup(self, x: Vector) -> tuple[int, float]:
        """Return the nearest node's index and its squared distance; the lowest index on a tie.

        Raises:
            ValueError: If there is no node yet, or `x` is not a vector of bytes of that length.
        """
        distances = self.distances(x)
        nearest = int(distances.argmin())
        return nearest, float(distances[nearest])

    def distances(self, x: Vector) -> NDArray[np.float64]:
        """Return the squared distance of `x` to every node, shape (n,); raises as `lookup`."""
        if self._size == 0:
            raise ValueError("nothing was learned yet")
        return self._measure(self._checked(x)).astype(np.float64)

    def train(self, x: Vector, group: int = 0) -> int:
        """Add one frame, merge the closest pair if there are too many; return x's nearest node.

        `group` is of no consequence: the published algorithm knows none.

        Raises:
            ValueError: If `x` is not a vector of bytes of the length learned so far.
        """
        image = self._checked(x)
        if self._size == 0:
            self._images = np.zeros((self.max_nodes + 1, image.size), self._dtype)
        self._size += 1
        self._insert(self._size - 1, image, 1, self._next_id)
        self._next_id += 1
        self.last_merge_ = None
        if self._size > self.max_nodes:
            self._merge_closest()
        return int(self._measure(image).argmin())

    @property
    def pinned_(self) -> NDArray[np.bool_]:
        """Which nodes are pinned, shape (n,); the paper knows no pins."""
        return self._pinned[: self._size].copy()

    def set_group(self, node: int, group: int) -> None:
        """Do nothing: the published algorithm knows no groups."""

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
        self._set_weights(node)

    def delete(self, node: int) -> int:
        """Forget one node and return the index of the last, which takes its place.

        Raises:
            ValueError: If it is pinned.
        """
        if self._pinned[node]:
            raise ValueError("a pinned node cannot be deleted; unpin it first")
        last = self._size - 1
        self._move(last, node)
        self._size = last
        return last

    def get_state(self) -> State:
        """Return a copy of all that was learned."""
        arrays = {name: getattr(self, f"_{name}").copy() for name in _ARRAYS}
        params = {"max_nodes": self.max_nodes, "size": self._size, "next_id": self._next_id}
        return State(kind="published", params=params, arrays=arrays)

    def set_state(self, state: State) -> None:
        """Become the clustering that gave `state`; raises ValueError if of another kind."""
        if state.kind != "published":
            raise ValueError(f"the model is a {state.kind}, not published")
        self.max_nodes = int(state.params["max_nodes"])
        self._size = int(state.params["size"])
        self._next_id = int(state.params["next_id"])
        for name in _ARRAYS:
            setattr(self, f"_{name}", state.arrays[name].copy())
        self._images = self._images.astype(self._dtype)
        self.last_merge_ = None

    def _checked(self, x: Vector) -> NDArray[Any]:
        array = checked_bytes(x, self._images.shape[1] or None)
        pixels: NDArray[Any] = array.astype(self._dtype)
        return pixels

    def _measure(self, image: NDArray[Any]) -> Integers:
        """Squared distances; int32 products may wrap, their sum is exact below 2 ** 31."""
        products = self._images[: self._size] @ image
        norm = image @ image
        if self.integer:
            wrapped = self._norms[: self._size].astype(np.int32) - 2 * products + norm
        else:
            wrapped = self._norms[: self._size] - 2.0 * products + norm
        distances: Integers = wrapped.astype(np.int64)
        return distances

    def _insert(self, index: int, image: NDArray[Any], count: int, name: int) -> None:
        self._images[index] = image
        self._norms[index] = int(image @ image)
        self._counts[index] = count
        self._ids[index] = name
        self._set_weights(index)

    def _set_weights(self, node: int) -> None:
        size = self._size
        weights = self._measure(self._images[node]) * np.maximum(
            self._counts[:size], self._counts[node]
        )
        weights[self._pinned[:size] | self._pinned[node]] = _NEVER
        weights[node] = _NEVER
        self._weights[node, :size] = weights
        self._weights[:size, node] = weights

    def _merge_closest(self) -> None:
        kept, removed = divmod(int(self._weights.argmin()), self.max_nodes + 1)
        heavy, light = int(self._counts[kept]), int(self._counts[removed])
        total = heavy + light
        sums = heavy * self._images[kept].astype(np.int64) + light * self._images[removed].astype(
            np.int64
        )
        merged = ((2 * sums + total) // (2 * total)).astype(self._dtype)
        name = int(self._ids[kept] if heavy >= light else self._ids[removed])
        last = self._size - 1
        self._move(last, removed)
        self._size = last
        self._insert(kept, merged, total, name)
        if removed != last:
            self.last_merge_ = Merge(kept=kept, removed=removed)

    def _move(self, source: int, target: int) -> None:
        for array in (self._images, self._norms, self._counts, self._ids, self._pinned):
            array[target] = array[source]
        self._weights[target] = self._weights[source]
        self._weights[:, target] = self._weights[:, source]
        self._pinned[source] = False
        self._weights[target, target] = _NEVER
        self._weights[source, :] = _NEVER
        self._weights[:, source] = _NEVER
