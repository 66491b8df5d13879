"""Bounded Self-Organizing Clusters: at most `max_nodes` images that summarise all frames seen.

Source: Ferrer, "Bounded Self-Organizing Clusters", FLAIRS-30 (2017). The paper compares images
pixel by pixel after every merge. Here a merged node's distances are computed from the known
distances (Lance and Williams 1967, centroid linkage), so a training step is one pass over the
nodes. `robot.learner.published` is the algorithm exactly as published.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector, checked_vector
from robot.learner.clusters import SHARED, Clusters
from robot.learner.part import MOST_DISTANCE, MOST_VALUES, Array, Stateful, Value
from robot.learner.values import number
from robot.learner.votes import HELD_OUT, Distances

Floats = NDArray[np.float32]
MOST_NORM = 1e24
"""Upper bound of a squared norm, so that the most expensive merge has a finite cost in float32."""
CACHED_FROM = 200
"""With fewer nodes than this, the minimum of each row is not cached. For 128 and 1024 nodes, one
argmin takes 2 us and 340 us, and updating the cache takes 9 us and 25 us."""


class Edges:
    """A symmetric matrix of weights; infinite where there is no edge or a node is pinned."""

    def __init__(self, n: int, dtype: type[Any]) -> None:
        self.weights = np.full((n, n), np.inf, dtype)
        self.pinned = np.zeros(n, np.bool_)
        self.n_pinned = 0
        self._n = n
        self._is_cached = n >= CACHED_FROM
        self._least = np.full(n, np.inf, dtype)
        self._partner = np.zeros(n, np.int64)

    def smallest(self) -> tuple[float, int, int]:
        """Return the smallest weight and the two nodes of its edge; on a tie, the lowest nodes."""
        if self._is_cached:
            one = int(self._least.argmin())
            return float(self._least[one]), one, int(self._partner[one])
        one, two = divmod(int(self.weights.argmin()), self._n)
        return float(self.weights[one, two]), one, two

    def set_row(self, node: int, weights: Distances) -> None:
        """Set the weights of the edges between one node and the first `len(weights)` nodes."""
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
        """Move the last node to the index of `node`, which is removed."""
        row = self.weights[last, :last].copy()
        self.weights[last, :] = self.weights[:, last] = np.inf
        if node != last:
            self.weights[node, :last] = self.weights[:last, node] = row
            self.weights[node, node] = np.inf
        if self._is_cached:
            self._rescan(np.arange(self._n))

    def _rescan(self, rows: NDArray[np.intp]) -> None:
        """Find and cache the smallest weight of each of these rows."""
        self._partner[rows] = partners = self.weights[rows].argmin(axis=1)
        self._least[rows] = self.weights[rows, partners]


class Images(Stateful):
    """Stores the nodes' images in rows, and compares one frame `x` at a time with them.

    Images are stored relative to the first frame. Products of raw bytes in float32 would lose the
    small differences between near-duplicates.
    """

    kind: ClassVar[str] = "bsoc"
    """Name of the file format of a clustering that stores its images in this way."""
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
        """Set length and origin from vector `x`. Raises ValueError if its values are too large."""
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
        """Add the measured vector to a node's image, which is the mean of `count` frames."""
        self._blend(row, self._x, 1.0 / (count + 1))

    def merge(self, kept: int, removed: int, count_kept: int, count_removed: int) -> None:
        """Merge image `removed` into image `kept`; the freed row stores the measured vector."""
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
        """Return the compared values of each image, shape (size, n), minus a common vector."""
        return self._rows[:size]

    def follow(self, counts: NDArray[np.int64]) -> None:
        """Update the number of frames of each image; the base class does not use these numbers."""

    def faults(self) -> Iterator[str]:
        norms = 0.5 * np.einsum("ij,ij->i", self._rows, self._rows)
        if not np.allclose(self._norms, norms, rtol=1e-3, atol=0.1):
            yield "the array norms does not match the images"

    def restored(self) -> None:
        self._set_origin(self._origin)


class BSOC(Clusters):
    """An online clustering of bounded size.

    Args:
        max_nodes: Maximum number of nodes; the only parameter of the algorithm.
        group_cost: Factor by which a merge of nodes of two groups (such as labels) costs more. With
            1 the clustering is the paper's, which has no groups.
        images: Stores and compares the images of the nodes. By default, pixels are float32;
            `IntegerImages` uses only integers.
    """

    measures_novelty = True
    fields = (
        *SHARED,
        Value("group_cost", number(1.0, 1e6), "group_cost"),
        Array("touched", np.int64, ("n_rows",)),
        Array("groups", np.int64, ("n_rows",)),
        Array("distances", np.float32, ("n_rows", "n_rows"), -MOST_DISTANCE, MOST_DISTANCE),
    )

    def __init__(
        self,
        max_nodes: int,
        *,
        group_cost: float = 1.0,
        images: Images | None = None,
    ) -> None:
        super().__init__(max_nodes, max_nodes, Edges, np.float32)
        if group_cost < 1.0:
            raise ValueError(f"group_cost must be at least 1, not {group_cost}")
        self.group_cost = group_cost
        self._masses = np.zeros(max_nodes, np.float32)  # the weight of each node
        self._touched = np.zeros(max_nodes, np.int64)
        self._groups = np.zeros(max_nodes, np.int64)
        self._distances = np.zeros((max_nodes, max_nodes), np.float32)
        self._images = images or Images(max_nodes)

    @property
    def nodes_(self) -> NDArray[np.float32]:
        """Image of each node, shape (n, d), float32."""
        return self._images.nodes(self.n_nodes_)

    @property
    def groups_(self) -> NDArray[np.int64]:
        """Group of each node, shape (n,)."""
        return self._groups[: self.n_nodes_].copy()

    @property
    def touched_(self) -> NDArray[np.int64]:
        """For each node, the number of the frame that updated it last, shape (n,); for pinned
        nodes, the number of the latest frame."""
        if not self._edges.n_pinned:
            return self._touched[: self.n_nodes_].copy()
        return np.where(self._edges.pinned, self.n_trained_, self._touched)[: self.n_nodes_]

    def distances(self, x: Vector) -> Floats:
        if self.n_nodes_ == 0:
            raise ValueError("nothing was learned yet")
        return 2.0 * self._images.measure(x, self.n_nodes_)

    def train(self, x: Vector, group: int = 0) -> int:
        """Add one frame in time O(max_nodes * d + max_nodes ** 2); see `Clusters.train`."""
        if self.n_trained_ == 0:
            self._images.begin(x)
        size = self.n_nodes_
        distances = self._images.measure(x, size)  # `distances` are half the squared distances
        self.last_merge_ = None
        self.last_distance_ = self._held_out(distances)
        self.last_distances_, self.last_touched_ = 2.0 * distances, self.touched_
        name = self.n_trained_
        self.n_trained_ = name + 1
        if size < self.max_nodes:
            self.n_nodes_ = size + 1
            self._place(size, np.append(distances, np.float32(0.0)), group, name)
            self._images.put(size)
            return int(self._distances[size, : size + 1].argmin())
        weights = distances * self._masses
        self._make_dear(weights, group)
        if self._edges.n_pinned:
            weights[self._edges.pinned] = np.inf
        nearest = int(weights.argmin())
        least, kept, removed = self._edges.smallest()
        # If two pairs are equally near, merge the pair with the lower indices. The new frame has
        # the highest index.
        if least < weights[nearest] or (least == weights[nearest] and kept <= nearest):
            counts = self._merge(kept, removed, distances)
            self._place(removed, distances, group, name)
            self._images.merge(kept, removed, *counts)
        else:
            self._absorb(nearest, distances)
        return int(distances.argmin())

    def _held_out(self, distances: Floats) -> float | None:
        """Return the squared distance of the nearest node that got no recent frame."""
        if self.n_trained_ <= HELD_OUT or not distances.size:
            return None
        is_recent = self._touched[: distances.size] >= self.n_trained_ - HELD_OUT
        held = np.where(is_recent, np.float32(np.inf), distances)
        nearest = int(held.argmin())
        if is_recent[nearest]:  # if all nodes are recent, use the nearest node
            nearest = int(distances.argmin())
        return 2.0 * float(distances[nearest])

    def _absorb(self, node: int, distances: Floats) -> None:
        """Merge the measured frame into a node, and change `distances` accordingly."""
        self._touched[node] = self.n_trained_
        count = int(self._counts[node])
        share = 1.0 / (count + 1)
        row = self._blended(self._distances[node], distances, share, float(distances[node]))
        self._counts[node] = self._masses[node] = count + 1
        self._set_row(node, row)
        distances[node] *= (1.0 - share) ** 2
        self._images.absorb(node, count)

    def _merge(self, kept: int, removed: int, distances: Floats) -> tuple[int, int]:
        """Merge one node into another, but not their images. Update the measured frame's
        `distances`. Return how many frames each of the two nodes had before the merge."""
        count, other = int(self._counts[kept]), int(self._counts[removed])
        share = other / (count + other)
        between = float(self._distances[kept, removed])
        row = self._blended(self._distances[kept], self._distances[removed], share, between)
        one, two = float(distances[kept]), float(distances[removed])
        distances[kept] = one + share * (two - one) - share * (1.0 - share) * between
        distances[removed] = 0.0
        self._counts[kept] = self._masses[kept] = count + other
        if other > count:
            self.names[kept] = self.names[removed]
            self._groups[kept] = self._groups[removed]
        self._touched[kept] = max(self._touched[kept], self._touched[removed])
        self._set_row(kept, row)
        self.last_merge_ = kept, removed
        return count, other

    def _blended(self, one: Floats, two: Floats, share: float, between: float) -> Floats:
        """Return the distances from each node k to the union of nodes i and j (Lance-Williams): wi
        d(k, i) + wj d(k, j) - wi wj d(i, j); wi and wj are the shares of their frames."""
        row: Floats = two - one
        row *= share
        row += one
        row -= share * (1.0 - share) * between
        return row

    def _place(self, node: int, distances: Floats, group: int, name: int) -> None:
        """Make a node from the measured frame; the caller stores its image."""
        self._counts[node] = self._masses[node] = 1
        self._groups[node] = group
        self.names[node] = name
        self._touched[node] = self.n_trained_
        self._set_row(node, distances)

    def _set_row(self, node: int, row: Floats) -> None:
        """Write one node's distances to all other nodes, and the resulting weights."""
        row[node] = 0.0
        size = row.size
        self._distances[node, :size] = row
        self._distances[:size, node] = row
        self._edges.set_row(node, self._costs(node))

    def _costs(self, node: int) -> Floats:
        size = self.n_nodes_
        weights: Floats = np.maximum(self._masses[:size], self._masses[node])
        weights *= self._distances[node, :size]
        self._make_dear(weights, self._groups[node])
        return weights

    def _make_dear(self, weights: Floats, group: int) -> None:
        """Raise the weights between one node and the nodes of other groups."""
        if self.group_cost != 1.0:
            weights[self._groups[: weights.size] != group] *= self.group_cost

    def set_group(self, node: int, group: int) -> None:
        self._groups[node] = group
        self._edges.set_row(node, self._costs(node))

    def _move(self, last: int, node: int) -> None:
        if node != last:
            self._images.move(last, node)
            for array in (self._masses, self._touched, self._groups):
                array[node] = array[last]
            row = self._distances[last, :last].copy()
            row[node] = 0.0
            self._distances[node, :last] = row
            self._distances[:last, node] = row
        super()._move(last, node)

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        return (("", self._images),)

    def restored(self) -> None:
        self._images.follow(self._counts)
        self._masses = self._counts.astype(np.float32)
        misfit, right = self._misfit()
        if 0.1 < misfit <= 1.0:  # larger than the rounding errors that learning accumulates
            self._distances[: self.n_nodes_, : self.n_nodes_] = right
        super().restored()

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if self._touched.max(initial=0) > self.n_trained_:
            yield "an image was changed by a frame that was not learned"
        with np.errstate(all="ignore"):
            if not self._misfit()[0] <= 1.0:
                yield "the distances do not match the images"

    def _misfit(self) -> tuple[float, Floats]:
        """Return the error of the stored distances, and the exact distances between the images.

        Each stored distance is computed from earlier stored distances, so rounding errors add up.
        Even after many frames, the returned error is below 1.
        """
        size = self.n_nodes_
        rows = self._images.compared(size)
        norms = 0.5 * np.einsum("ij,ij->i", rows, rows)
        right: Floats = np.maximum(norms[:, None] + norms - rows @ rows.T, 0.0)
        np.fill_diagonal(right, 0.0)
        off = np.abs(self._distances[:size, :size] - right).max(initial=0.0)
        return float(off) / (0.05 * float(norms.max(initial=0.0)) + 1.0), right

    @property
    def kind(self) -> str:
        return self._images.kind
