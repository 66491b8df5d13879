"""Images with the labels of their frames: what a model saves, and what a person edits.

Each node of the clustering counts the labels of the frames merged into it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner import votes
from robot.learner.base import Label, Learner, Mirror, Node, State, Vector
from robot.learner.clusters import MOST_FRAMES, Clusters
from robot.learner.linear import LinearPart
from robot.learner.part import Array, Stateful, Value
from robot.learner.ridge import MIRRORED, RecursiveRidge
from robot.learner.values import count

_TURNED = np.array([-1.0, 1.0])
"""Factors for (angle, |angle|) when an image is mirrored: only the angle's sign changes."""


class LabelledImages(Stateful, Learner):
    """The state of a `BSOCClassifier`, and the changes that a person makes to it.

    Attributes:
        labels_: The labels, in the order in which they were first taught.
        n_seen_: Number of learned frames.
    """

    n_voters: int
    fields = (
        Value("n_voters", count(), "n_voters", is_fixed=True),
        Value("n_seen", count(), "n_seen_"),
        Array("histograms", np.int64, ("max_nodes", "n_labels"), high=MOST_FRAMES),
        Array(
            "node_angles", np.float64, ("max_nodes", 3), -MOST_FRAMES, MOST_FRAMES, is_optional=True
        ),
    )

    def __init__(
        self,
        max_nodes: int,
        cluster: Clusters,
        linear: LinearPart | None,
        novelty: votes.Novelty,
        mind: votes.ChangeOfMind | None,
    ) -> None:
        self.max_nodes, self.cluster, self.linear = max_nodes, cluster, linear
        self.novelty_, self._mind = novelty, mind
        self.labels_: list[Label] = []
        self.n_seen_ = 0
        self._histograms = np.zeros((max_nodes, 0), np.int64)
        # For each node, the sums of its frames' `angle_terms` (angles from -1 to 1).
        self._node_angles: votes.Floats | None = None

    @property
    def histograms_(self) -> NDArray[np.int64]:
        """Labels counted per node, shape (n, len(labels_))."""
        return self._histograms[: self.cluster.n_nodes_].copy()

    def _know(self, y: Label) -> int:
        """Return the column of a label; add a column for a new label."""
        if y not in self.labels_:
            self.labels_.append(y)
            new = np.zeros((self.max_nodes, 1), np.int64)
            self._histograms = np.hstack([self._histograms, new])
            if self.linear is not None:
                self.linear.add_label()
            if self._mind is not None:
                self._mind.add_label()
        return self.labels_.index(y)

    def begin_like(self, earlier: Sequence[State]) -> int:
        linear = self.linear
        if not isinstance(linear, RecursiveRidge) or self.n_seen_:
            return 0
        alike = [
            (state.labels, state.arrays["linear"])
            for state in earlier
            if state.kind == self._kind and state.arrays["linear"].shape[0] == linear.size
        ]
        # The mean over several places keeps what their weights have in common.
        for labels, weights in alike:
            linear.begin_like([self._know(label) for label in labels], weights / len(alike))
        return len(alike)

    def begin_angles(self, of_labels: Mapping[Label, float]) -> None:
        if self._node_angles is None:
            angles = np.array([of_labels.get(label, 0.0) for label in self.labels_])
            self._node_angles = self._histograms.astype(np.float64) @ votes.angle_terms(angles)
            if self.linear is not None:
                self.linear.begin_angles(angles)

    def reflect(self, mirror: Mirror, on: bool) -> None:
        if not isinstance(self.linear, RecursiveRidge):
            super().reflect(mirror, on)
        elif on != (self.mirror is not None):
            for label in [*self.labels_] if on else ():
                self._know(mirror.labels.get(label, label))
            self.linear.reflect(mirror.places, self._columns(mirror), on)
            self.mirror = mirror if on else None

    def _columns(self, mirror: Mirror) -> list[int]:
        """Return the column of each label's mirrored label, or its own if that was never taught."""
        known = {label: column for column, label in enumerate(self.labels_)}
        return [known.get(mirror.labels.get(label, label), known[label]) for label in self.labels_]

    def _mirrored(
        self, x: Vector, per_label: votes.Floats, angle: votes.Floats | float
    ) -> tuple[Vector, votes.Floats, votes.Floats | float]:
        """Return a vector, its value per label, and its angle and magnitude, all mirrored."""
        assert self.mirror is not None
        return x[self.mirror.places], per_label[self._columns(self.mirror)], angle * _TURNED

    def nodes(self) -> list[Node]:
        cluster, angles = self.cluster, self._node_angles
        images, frames, pinned = cluster.nodes_, cluster.counts_.tolist(), cluster.pinned_.tolist()
        ids, histograms = cluster.ids_.tolist(), self.histograms_.tolist()
        return [
            Node(
                id=node_id,
                image=images[i],
                votes=dict(zip(self.labels_, counts, strict=True)),
                frames=frames[i],
                is_pinned=pinned[i],
                angle=None if angles is None else float(angles[i, 0]) / max(sum(counts), 1),
            )
            for i, (node_id, counts) in enumerate(zip(ids, histograms, strict=True))
        ]

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        others = (self.novelty_, self.linear, self._mind)
        own = [("", part) for part in others if part is not None]
        return [("cluster", self.cluster), *own]

    def get_state(self) -> State:
        params, arrays = self.save()
        return State(kind=self._kind, params=params, arrays=arrays, labels=list(self.labels_))

    def set_state(self, state: State) -> None:
        if state.kind != self._kind:
            raise ValueError(f"the model is a {state.kind}, not a {self._kind}")
        self.labels_ = list(state.labels)
        self.load(state.params, state.arrays, sizes={"n_labels": len(self.labels_)})

    def faults(self) -> Iterator[str]:
        if len(set(self.labels_)) < len(self.labels_):
            yield "a label occurs twice"
        # Labels without images are valid, because a person can delete the last image of a label.
        if self.n_nodes_ > 0 and not self.labels_:
            yield "it has images without labels"
        if self.cluster.groups_.max(initial=-1) >= len(self.labels_):
            yield "an image has a label that does not exist"
        if self._node_angles is not None and (self._node_angles[:, 1:] < 0.0).any():
            yield "a sum of magnitudes or of squares of angles is below zero"

    @property
    def _kind(self) -> str:
        return f"classifier{'+linear' if self.linear else ''}:{self.cluster.kind}"

    def relabel_node(self, node_id: int, y: Label, angle: float = 0.0) -> None:
        check_label(y, angle)
        index = self._index(node_id)
        column = self._know(y)
        before = self._histograms[index].copy()
        self._histograms[index] = 0
        n = self._histograms[index, column] = max(int(before.sum()), 1)
        turned = n * votes.angle_terms(angle)
        if self._node_angles is not None:
            turned, self._node_angles[index] = turned - self._node_angles[index], turned
        if self.linear is not None:
            change = (self._histograms[index] - before).astype(np.float64)
            image, steered = self.cluster.nodes_[index], turned[:2]
            self.linear.retarget(image, change, steered)
            if self.mirror is not None:
                self.linear.retarget(*self._mirrored(image, MIRRORED * change, MIRRORED * steered))
        self.cluster.set_group(index, column)

    def delete_node(self, node_id: int) -> None:
        index = self._index(node_id)
        image, frames = self.cluster.nodes_[index], float(self.cluster.counts_[index])
        last = self.cluster.delete(index)
        angle = 0.0 if self._node_angles is None else self._node_angles[index, :2] / frames
        if self.linear is not None:
            shares = self._histograms[index] / frames
            self.linear.forget(image, shares, frames, angle)
            if self.mirror is not None:
                image, shares, angle = self._mirrored(image, shares, angle)
                self.linear.forget(image, shares, MIRRORED * frames, angle)
        for sums in self._sums():
            sums[index] = sums[last]
            sums[last] = 0

    def _sums(self) -> list[NDArray[Any]]:
        """Return the arrays of sums over each node's frames."""
        return [sums for sums in (self._histograms, self._node_angles) if sums is not None]

    def outdate(self) -> None:
        if self._mind is None:
            super().outdate()
        else:
            self._mind.outdate(self.cluster.n_trained_ + 1)

    def pin_node(self, node_id: int, pinned: bool = True) -> None:
        self.cluster.pin(self._index(node_id), pinned)

    def _index(self, node_id: int) -> int:
        found = np.flatnonzero(self.cluster.ids_ == node_id)
        if found.size == 0:
            raise LookupError(f"there is no node {node_id}")
        return int(found[0])


def check_label(label: Label, angle: float) -> None:
    """Raise ValueError for an invalid label or angle, before anything changes."""
    if not isinstance(label, str) or not label:
        raise ValueError(f"a label must be a string, not {label!r}")
    if not -1.0 <= angle <= 1.0:
        raise ValueError(f"an angle must lie in [-1, 1], not {angle}")
