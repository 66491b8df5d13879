"""Adds labels to the clustering: each node counts the labels of the frames merged into it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from robot.learner import votes
from robot.learner.base import (
    Abilities,
    Evidence,
    Label,
    Learner,
    Mirror,
    Node,
    NotFittedError,
    State,
    Vector,
)
from robot.learner.bsoc import BSOC
from robot.learner.clusters import MOST_FRAMES, Clusters
from robot.learner.integer_images import IntegerImages
from robot.learner.linear import EVERY, LinearPart
from robot.learner.part import Array, Stateful, Value
from robot.learner.published import PublishedBSOC
from robot.learner.ridge import MIRRORED, RecursiveRidge
from robot.learner.values import count

GROUP_COST = 1000.0
"""Factor by which a merge of nodes of two labels costs more, so that it is the last resort."""
N_VOTERS = 3
LINEAR_SHARE = 0.7
CONTEXT_SHARE = 0.85
"""Weight of the linear part within a context; the images' votes do not depend on the context."""
_TURNED = np.array([-1.0, 1.0])
"""Factors for (angle, |angle|) when an image is mirrored: only the angle's sign changes."""
SHARPNESS = 1.6
"""Power that calibrates the mixture's probabilities, for all rooms
(docs/explanation/learner.md)."""


class BSOCClassifier(Stateful, Learner):
    """A classifier of at most `max_nodes` learned images.

    Args:
        max_nodes: Maximum number of images.
        group_cost: Factor by which a merge of two labels costs more; 1 as published.
        n_voters: Number of nearest nodes that vote.
        linear: An online linear part, whose scores are mixed with the votes; None for no linear
            part. With a `ContextRidge`, predictions can depend on the current move.
        linear_share: Weight of the linear part in the mixture.
        integer: Compute on the nodes' pixels in integers only; vectors are then bytes.
        cluster: The clustering; if None, a label-aware `BSOC`.
        balance: Extra weight of rare labels, from 0 to 1 (`votes.rarity`).
        novelty_margin: Distance beyond the usual distances at which a view is novel (`Novelty`).
        forgets: True to follow a pilot who relabels the same views (`votes.ChangeOfMind`); no
            effect with a clustering that measures no novelty.

    Example:
        >>> learner = BSOCClassifier(max_nodes=2)
        >>> learner.learn_one(np.array([0.0, 1.0]), "left")
        >>> learner.predict_one(np.array([0.0, 0.9]))
        'left'
    """

    fields = (
        Value("n_voters", count(), "n_voters", is_fixed=True),
        Value("n_seen", count(), "n_seen_"),
        Array("histograms", np.int64, ("max_nodes", "n_labels"), high=MOST_FRAMES),
        Array(
            "node_angles", np.float64, ("max_nodes", 3), -MOST_FRAMES, MOST_FRAMES, may_miss=True
        ),
    )

    def __init__(
        self,
        max_nodes: int = 32,
        *,
        group_cost: float = GROUP_COST,
        n_voters: int = N_VOTERS,
        linear: LinearPart | None = None,
        linear_share: float = LINEAR_SHARE,
        balance: float = 0.0,
        novelty_margin: float = votes.MARGIN,
        integer: bool = False,
        cluster: Clusters | None = None,
        forgets: bool = True,
    ) -> None:
        if n_voters < 1:
            raise ValueError(f"n_voters must be at least 1, not {n_voters}")
        self.max_nodes, self.n_voters = max_nodes, n_voters
        if cluster is None:  # compare with None, because an empty clustering is false
            images = IntegerImages(max_nodes) if integer else None
            cluster = BSOC(max_nodes, group_cost=group_cost, images=images)
        self.cluster = cluster
        self.labels_: list[Label] = []
        self.n_seen_ = 0
        self.linear = linear
        self.linear_share = linear_share
        self.sharpness = SHARPNESS if linear is not None else 1.0
        self.abilities = Abilities(
            images=True,
            pinning=True,
            novelty=cluster.measures_novelty,
            contexts=linear is not None and linear.knows_contexts,
            angles=True,
            mirrors=isinstance(linear, RecursiveRidge),
        )
        self.balance = balance
        self.novelty_ = votes.Novelty(margin=novelty_margin)
        self._mind = votes.ChangeOfMind() if forgets and cluster.measures_novelty else None
        self._histograms = np.zeros((max_nodes, 0), np.int64)
        # For each node, the sums of its frames' `angle_terms` (angles from -1 to 1).
        self._node_angles: votes.Floats | None = None

    @classmethod
    def published(cls, max_nodes: int = 32, *, integer: bool = False) -> Self:
        """Return the paper's classifier: the nearest node's most counted label."""
        return cls(max_nodes, n_voters=1, cluster=PublishedBSOC(max_nodes, integer=integer))

    @property
    def n_nodes_(self) -> int:
        return self.cluster.n_nodes_

    @property
    def histograms_(self) -> NDArray[np.int64]:
        """Labels counted per node, shape (n, len(labels_))."""
        return self._histograms[: self.cluster.n_nodes_].copy()

    def learn_one(self, x: Vector, y: Label) -> None:
        self.learn_in(x, y, EVERY)

    def begin_like(self, earlier: Sequence[State]) -> int:
        linear = self.linear
        if not isinstance(linear, RecursiveRidge) or self.n_seen_:
            return 0
        alike = [
            (state.labels, state.arrays["linear"])
            for state in earlier
            if state.kind == self._kind and state.arrays["linear"].shape[0] == linear.size
        ]
        # In the mean, the differences between places cancel out, and their common part remains.
        for labels, weights in alike:
            linear.begin_like([self._know(label) for label in labels], weights / len(alike))
        return len(alike)

    def begin_angles(self, of_labels: Mapping[Label, float]) -> None:
        if self._node_angles is None:
            angles = np.array([of_labels.get(label, 0.0) for label in self.labels_])
            self._node_angles = self._histograms.astype(np.float64) @ votes.angle_terms(angles)
            if self.linear is not None:
                self.linear.begin_angles(angles)

    def learn_in(
        self, x: Vector, y: Label, contexts: Collection[int], angle: float | None = None
    ) -> None:
        _check(y, angle or 0.0)
        if self.linear is not None and np.size(x) < self.linear.n_features:
            least = self.linear.n_features
            raise ValueError(f"the vector has {np.size(x)} values; the linear part needs {least}")
        column = self.labels_.index(y) if y in self.labels_ else len(self.labels_)
        cluster, owners = self.cluster, self._owners()
        node = cluster.train(x, column)
        for label in (y,) if self.mirror is None else (y, self.mirror.labels.get(y, y)):
            if label not in self.labels_:
                self._know(label)
        if cluster.last_merge_ is not None:
            kept, removed = cluster.last_merge_
            for sums in (self._histograms, self._node_angles):
                if sums is not None:
                    sums[kept] += sums[removed]
                    sums[removed] = 0
        if self._mind is not None:
            # The distances and `owners` were computed before any merge.
            distances, taught = cluster.last_distances_, cluster.last_touched_
            self._mind.note(column, distances, owners, taught, cluster.n_trained_)
        self._histograms[node, column] += 1
        self.n_seen_ += 1
        self.last_node_ = int(cluster.names[node])
        steered: votes.Floats | float = 0.0
        if self._node_angles is not None:
            terms = votes.angle_terms(angle or 0.0)
            self._node_angles[node] += terms
            steered = terms[:2]
        if cluster.last_distance_ is not None:
            self.novelty_.learn(cluster.last_distance_)
        if self.linear is not None:
            targets = np.zeros(len(self.labels_))
            targets[column] = 1.0
            self.linear.learn(x, targets, steered, contexts)
            if self.mirror is not None and isinstance(self.linear, RecursiveRidge):
                self.linear.learn_mirrored(*self._mirrored(x, targets, steered), contexts)

    def reflect(self, mirror: Mirror, on: bool) -> None:
        if not isinstance(self.linear, RecursiveRidge):
            super().reflect(mirror, on)
        elif on != (self.mirror is not None):
            for label in [*self.labels_] if on else ():
                self._know(mirror.labels.get(label, label))
            self.linear.reflect(mirror.places, self._columns(mirror), on)
            self.mirror = mirror if on else None

    def _columns(self, mirror: Mirror) -> list[int]:
        """Return each label's mirrored label if that was taught, else the label itself."""
        known = {label: column for column, label in enumerate(self.labels_)}
        return [known.get(mirror.labels.get(label, label), known[label]) for label in self.labels_]

    def _mirrored(
        self, x: Vector, per_label: votes.Floats, angle: votes.Floats | float
    ) -> tuple[Vector, votes.Floats, votes.Floats | float]:
        """Return a vector, its value per label, and its angle and magnitude, all mirrored."""
        assert self.mirror is not None
        return x[self.mirror.places], per_label[self._columns(self.mirror)], angle * _TURNED

    def _owners(self) -> NDArray[np.int64]:
        """Return the label with the most votes of each node, shape (n,); -1 without votes."""
        counts = self._histograms[: self.cluster.n_nodes_]
        owners = counts.argmax(axis=1) if counts.size else np.zeros(len(counts), np.int64)
        owners[~counts.any(axis=1)] = -1
        return owners

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

    def explain_one(self, x: Vector) -> Evidence:
        return self.explain_in(x, None)

    def explain_in(self, x: Vector, context: int | None) -> Evidence:
        cluster, linear, mind = self.cluster, self.linear, self._mind
        if cluster.n_nodes_ == 0:
            raise NotFittedError("nothing was learned yet")
        owners, histograms = self._owners(), self._histograms[: cluster.n_nodes_]
        per_label = histograms.sum(axis=0)
        if self.mirror is not None and self.balance:
            per_label = per_label + MIRRORED * per_label[self._columns(self.mirror)]
        touched, distances = cluster.touched_, cluster.distances(x)
        scores = np.maximum(linear.scores(x, context), 0.0) if linear is not None else np.zeros(0)
        shares = votes.nearest_nodes(distances, histograms, self.n_voters)
        if linear is not None:
            is_known = context is not None and linear.knows_contexts
            share = max(self.linear_share, CONTEXT_SHARE) if is_known else self.linear_share
            shares = share * scores + (1.0 - share) * shares
        if self.balance:
            shares = shares * votes.rarity(per_label, self.balance)
        if mind is not None:
            shares = mind.applied(shares, distances, owners, touched)
        total = float(shares.sum())
        shares = shares / total if total > 0.0 else np.full(shares.size, 1.0 / shares.size)
        node, sums = int(distances.argmin()), self._node_angles
        listed = shares.tolist()
        best = listed.index(max(listed))
        angle, size, spread = (None,) * 3 if sums is None else self._angle(x, distances, sums)
        return Evidence(
            label=self.labels_[best],
            probabilities=dict(zip(self.labels_, listed, strict=True)),
            confidence=votes.chance(listed, best, self.sharpness),
            novelty=self.novelty_.score(float(distances[node])),
            node=int(cluster.names[node]),
            distance=float(distances[node]),
            angle=angle,
            size=size,
            spread=spread,
        )

    def _angle(
        self, x: Vector, distances: votes.Distances, sums: votes.Floats
    ) -> tuple[float | None, ...]:
        """Return angle, magnitude and standard deviation, mixed like the votes."""
        frames = self._histograms[: distances.size].sum(axis=1)
        both, spread = votes.mean_angle(distances, sums, frames, self.n_voters)
        linear = None if self.linear is None else self.linear.angle(x)
        if linear is not None:
            both = both + self.linear_share * (linear - both)
        return (*both.tolist(), spread)

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
        # A label may have no images, because its last image may have been deleted.
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
        _check(y, angle)
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


def _check(label: Label, angle: float) -> None:
    """Raise ValueError for an invalid label or angle, before anything changes."""
    if not isinstance(label, str) or not label:
        raise ValueError(f"a label must be a string, not {label!r}")
    if not -1.0 <= angle <= 1.0:
        raise ValueError(f"an angle must lie in [-1, 1], not {angle}")
