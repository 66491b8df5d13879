"""Bounded Self-Organizing Clusters: at most `max_nodes` images that sum up all that was seen.

Source: Ferrer, "Bounded Self-Organizing Clusters", FLAIRS-30 (2017). The paper compares images
pixel by pixel after every merge; here a merged node's distances follow from those already known
(Lance and Williams 1967, centroid linkage), so that a training step is one pass over the nodes.
`robot.learner.published` is the algorithm exactly as published.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.learner.clusters import MOST_FRAMES, Clusters, Merge
from robot.learner.images import FloatImages, Images, IntegerImages
from robot.learner.novelty import HELD_OUT
from robot.learner.part import MOST_DISTANCE, Array, Stateful, Value
from robot.learner.values import count, number

Floats = NDArray[np.float32]


class BSOC(Clusters):
    """An online clustering of bounded size.

    Args:
        max_nodes: How many nodes to keep at most; the only parameter of the algorithm.
        group_cost: How many times dearer it is to merge nodes of two groups (labels, say).
            1 is as in the paper, which has no groups.
        integer: Compute on pixels in whole numbers alone; vectors are then bytes.
        n_compared: With `integer`: how many values of a vector are compared, from the first; None
            for all.

    Attributes:
        nodes_: Node images, shape (n, d), float32.
        counts_: How many frames each node sums up, shape (n,), int64.
        ids_: A name for each node that survives: a merged node keeps that of its heavier parent.
        last_merge_: What the latest `train` merged; None if the frame became a node without a
            merge, or was itself merged into the node that `train` returned.
        last_distance_: Squared distance of the latest frame from the nearest node before it that
            none of the `HELD_OUT` frames before it went into (of all, if there is no such node);
            None for the first frames.
        last_distances_: Squared distances of the latest frame from the nodes before any merge.
        last_touched_: When each node had got a frame then.
    """

    measures_novelty = True
    fields = (
        Value("max_nodes", count(), "max_nodes", is_fixed=True),
        Value("group_cost", number(1.0, 1e6), "group_cost"),
        Value("size", count(), "n_nodes_"),
        Value("next_id", count()),
        Array("ids", np.int64, ("max_nodes",)),
        Array("touched", np.int64, ("max_nodes",), older=0),
        Array("groups", np.int64, ("max_nodes",)),
        Array("pinned", np.bool_, ("max_nodes",)),
        Array("counts", np.int64, ("max_nodes",), high=MOST_FRAMES),
        Array("distances", np.float32, ("max_nodes", "max_nodes"), -MOST_DISTANCE, MOST_DISTANCE),
    )

    def __init__(
        self,
        max_nodes: int,
        *,
        group_cost: float = 1.0,
        integer: bool = False,
        n_compared: int | None = None,
    ) -> None:
        super().__init__(max_nodes, max_nodes, np.float32)
        if group_cost < 1.0:
            raise ValueError(f"group_cost must be at least 1, not {group_cost}")
        self.group_cost = group_cost
        self.integer = integer
        self.last_distances_, self.last_touched_ = np.zeros(0, np.float32), np.zeros(0, np.int64)
        # A list for exact counts, read one by one, and an array of them to weigh with.
        self._counts = [0] * max_nodes
        self._masses = np.zeros(max_nodes, np.float32)
        self._touched = np.zeros(max_nodes, np.int64)
        self._groups = np.zeros(max_nodes, np.int64)
        self._distances = np.zeros((max_nodes, max_nodes), np.float32)
        self._images: Images = (
            IntegerImages(max_nodes, n_compared) if integer else FloatImages(max_nodes)
        )

    @property
    def nodes_(self) -> NDArray[np.float32]:
        """Node images, shape (n, d)."""
        return self._images.nodes(self.n_nodes_)

    @property
    def counts_(self) -> NDArray[np.int64]:
        """Frames per node, shape (n,)."""
        return np.array(self._counts[: self.n_nodes_], np.int64)

    @property
    def groups_(self) -> NDArray[np.int64]:
        """Group of each node, shape (n,)."""
        return self._groups[: self.n_nodes_].copy()

    @property
    def n_trained_(self) -> int:
        """How many frames there were."""
        return self._next_id

    @property
    def touched_(self) -> NDArray[np.int64]:
        """When each node last got a frame, as a count of frames, shape (n,); a pinned one: now."""
        return np.where(self._pinned, self._next_id, self._touched)[: self.n_nodes_]

    def distances(self, x: Vector) -> Floats:
        """Return the squared distance of `x` to every node, shape (n,); raises as `lookup`."""
        if self.n_nodes_ == 0:
            raise ValueError("nothing was learned yet")
        return 2.0 * self._images.measure(x, self.n_nodes_)

    def train(self, x: Vector, group: int = 0) -> int:
        """Add one frame; merge the two nodes cheapest to merge if there are too many.

        Time O(max_nodes * d + max_nodes ** 2), whatever the number of frames seen.

        Returns:
            The index of the node nearest to `x` afterwards.

        Raises:
            ValueError: If `x` is of another shape than before or not finite; nothing changes.
        """
        if self._images.is_empty:
            self._images.begin(x)
        size = self.n_nodes_
        distances = self._images.measure(x, size)  # halved, here and in all that follows
        self.last_merge_ = None
        self.last_distance_ = self._held_out(distances)
        self.last_distances_, self.last_touched_ = 2.0 * distances, self.touched_
        name = self._next_id
        self._next_id = name + 1
        if size < self.max_nodes:
            self.n_nodes_ = size + 1
            self._place(size, np.append(distances, np.float32(0.0)), group, name)
            return int(self._distances[size, : size + 1].argmin())
        weights = distances * self._masses
        self._make_dear(weights, group)
        if self._n_pinned:
            weights[self._pinned] = np.inf
        nearest = int(weights.argmin())
        least, kept, removed = self._edges.smallest()
        # A tie goes to the lower pair of indices; the new frame's own index is the highest.
        if least < weights[nearest] or (least == weights[nearest] and kept <= nearest):
            self._merge(kept, removed, distances)
            self._place(removed, distances, group, name)
        else:
            self._absorb(nearest, distances)
        return int(distances.argmin())

    def _held_out(self, distances: Floats) -> float | None:
        """Find the nearest node that no recent frame went into; return its squared distance."""
        if self._next_id <= HELD_OUT or not distances.size:
            return None
        is_recent = self._touched[: distances.size] >= self._next_id - HELD_OUT
        held = np.where(is_recent, np.float32(np.inf), distances)
        nearest = int(held.argmin())
        if is_recent[nearest]:  # few nodes are all touched all the time; then the nearest has to do
            nearest = int(distances.argmin())
        return 2.0 * float(distances[nearest])

    def _absorb(self, node: int, distances: Floats) -> None:
        """Merge the measured frame into a node; updates `distances`."""
        self._touched[node] = self._next_id
        count = self._counts[node]
        share = 1.0 / (count + 1)
        row = self._blended(self._distances[node], distances, share, float(distances[node]))
        self._images.absorb(node, count)
        self._counts[node] = self._masses[node] = count + 1
        self._set_row(node, row)
        distances[node] *= (1.0 - share) ** 2

    def _merge(self, kept: int, removed: int, distances: Floats) -> None:
        """Merge one node into another; updates `distances` of the measured frame."""
        count, other = self._counts[kept], self._counts[removed]
        share = other / (count + other)
        between = float(self._distances[kept, removed])
        row = self._blended(self._distances[kept], self._distances[removed], share, between)
        one, two = float(distances[kept]), float(distances[removed])
        distances[kept] = one + share * (two - one) - share * (1.0 - share) * between
        distances[removed] = 0.0
        self._images.merge(kept, removed, count, other)
        self._counts[kept] = self._masses[kept] = count + other
        if other > count:
            self._ids[kept] = self._ids[removed]
            self._groups[kept] = self._groups[removed]
        self._touched[kept] = max(self._touched[kept], self._touched[removed])
        self._set_row(kept, row)
        self.last_merge_ = Merge(kept=kept, removed=removed)

    def _blended(self, one: Floats, two: Floats, share: float, between: float) -> Floats:
        """Lance-Williams: d(k, ij) = wi d(k, i) + wj d(k, j) - wi wj d(i, j)."""
        row: Floats = two - one
        row *= share
        row += one
        row -= share * (1.0 - share) * between
        return row

    def _place(self, node: int, distances: Floats, group: int, name: int) -> None:
        """Make the measured frame a node."""
        self._images.put(node)
        self._counts[node] = self._masses[node] = 1
        self._groups[node] = group
        self._ids[node] = name
        self._touched[node] = self._next_id
        self._pinned[node] = False
        self._set_row(node, distances)

    def _set_row(self, node: int, row: Floats) -> None:
        """Write one node's distances to all others, and the weights that follow from them."""
        row[node] = 0.0
        size = row.size
        self._distances[node, :size] = row
        self._distances[:size, node] = row
        self._weigh(node)

    def _costs(self, node: int) -> Floats:
        size = self.n_nodes_
        weights: Floats = np.maximum(self._masses[:size], self._masses[node])
        weights *= self._distances[node, :size]
        self._make_dear(weights, self._groups[node])
        return weights

    def _make_dear(self, weights: Floats, group: int) -> None:
        """Raise the weights of one node to those of other groups."""
        if self.group_cost != 1.0:
            weights[self._groups[: weights.size] != group] *= self.group_cost

    def set_group(self, node: int, group: int) -> None:
        """Move one node to another group."""
        self._groups[node] = group
        self._weigh(node)

    def _move(self, last: int, node: int) -> None:
        if node != last:
            self._images.move(last, node)
            self._counts[node] = self._counts[last]
            for array in (self._masses, self._ids, self._touched, self._groups, self._pinned):
                array[node] = array[last]
            row = self._distances[last, :last].copy()
            row[node] = 0.0
            self._distances[node, :last] = row
            self._distances[:last, node] = row
        self._pinned[last] = False
        self._edges.remove(node, last)

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        return (("", self._images),)

    def restored(self) -> None:
        counts = np.asarray(self._counts)
        self._images.follow(counts)
        self._counts, self._masses = counts.tolist(), counts.astype(np.float32)
        misfit, right = self._misfit()
        if 0.1 < misfit <= 1.0:  # not by learning alone
            self._distances[: self.n_nodes_, : self.n_nodes_] = right
        super().restored()

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if self._touched.max(initial=0) > self._next_id:
            yield "an image was touched by a frame that was not learned"
        with np.errstate(all="ignore"):
            if not self._misfit()[0] <= 1.0:
                yield "the distances do not fit the images"

    def _misfit(self) -> tuple[float, Floats]:
        """Return by how much the distances differ from those of the images, and the latter.

        Distances follow from one another, so that they are off by a little after many frames; 1 is
        more than that.
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
        """Name of the format of its state."""
        return "bsoc-integer" if self.integer else "bsoc"
