"""Learns and predicts labels, by images (`labelled_images.py`) and a linear part (`ridge.py`)."""

from __future__ import annotations

from collections.abc import Collection
from typing import Self

import numpy as np
from numpy.typing import NDArray

from robot.learner import votes
from robot.learner.base import Abilities, Evidence, Label, NotFittedError, Vector
from robot.learner.bsoc import BSOC
from robot.learner.clusters import Clusters
from robot.learner.integer_images import IntegerImages
from robot.learner.labelled_images import LabelledImages, check_label
from robot.learner.linear import EVERY, LinearPart
from robot.learner.published import PublishedBSOC
from robot.learner.ridge import MIRRORED, RecursiveRidge

GROUP_COST = 1000.0
"""Factor by which merging nodes of different labels costs more, so that it is the last resort."""
N_VOTERS = 3
LINEAR_SHARE = 0.7
CONTEXT_SHARE = 0.85
"""Weight of the linear part within a context; the images' votes do not depend on the context."""
SHARPNESS = 1.6
"""Exponent that calibrates the mixture's probabilities (docs/explanation/learner.md)."""


class BSOCClassifier(LabelledImages):
    """A classifier of at most `max_nodes` learned images.

    Args:
        max_nodes: Maximum number of images.
        group_cost: Factor on the cost of merging nodes of different labels; 1 as published.
        n_voters: Number of nearest nodes that vote.
        linear: An online linear part, whose scores are mixed with the votes; None for no linear
            part. With a `ContextRidge`, predictions can depend on the current move.
        linear_share: Weight of the linear part in the mixture.
        integer: Compute on the nodes' pixels in integers only; vectors are then bytes.
        cluster: The clustering; if None, a label-aware `BSOC`.
        balance: Extra weight of rare labels, from 0 to 1 (`votes.rarity`).
        novelty_margin: Raises the distance from which a view is novel (`Novelty.margin`).
        forgets: True to follow a pilot who relabels the same views (`votes.ChangeOfMind`); ignored
            if the clustering does not measure novelty.

    Example:
        >>> learner = BSOCClassifier(max_nodes=2)
        >>> learner.learn_one(np.array([0.0, 1.0]), "left")
        >>> learner.predict_one(np.array([0.0, 0.9]))
        'left'
    """

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
        images = IntegerImages(max_nodes) if integer else None
        cluster = cluster or BSOC(max_nodes, group_cost=group_cost, images=images)
        novelty = votes.Novelty(margin=novelty_margin)
        mind = votes.ChangeOfMind() if forgets and cluster.measures_novelty else None
        super().__init__(max_nodes, cluster, linear, novelty, mind)
        self.n_voters = n_voters
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

    @classmethod
    def published(cls, max_nodes: int = 32, *, integer: bool = False) -> Self:
        """Return the paper's classifier: it predicts the nearest node's most frequent label."""
        return cls(max_nodes, n_voters=1, cluster=PublishedBSOC(max_nodes, integer=integer))

    @property
    def n_nodes_(self) -> int:
        return self.cluster.n_nodes_

    def learn_one(self, x: Vector, y: Label) -> None:
        self.learn_in(x, y, EVERY)

    def learn_in(
        self, x: Vector, y: Label, contexts: Collection[int], angle: float | None = None
    ) -> None:
        if y not in self.labels_ or angle is not None:  # a known label is valid
            check_label(y, angle or 0.0)
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
            # `distances` and `owners` describe the nodes before this example caused a merge.
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

    def _owners(self) -> NDArray[np.int64]:
        """Return the column of each node's most frequent label, shape (n,); -1 without votes."""
        counts = self._histograms[: self.cluster.n_nodes_]
        owners = counts.argmax(axis=1) if counts.size else np.zeros(len(counts), np.int64)
        owners[~counts.any(axis=1)] = -1
        return owners

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
        shares = votes.shares(shares)
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
        """Return angle, magnitude and standard deviation, weighted in the same way as the votes."""
        frames = self._histograms[: distances.size].sum(axis=1)
        both, spread = votes.mean_angle(distances, sums, frames, self.n_voters)
        linear = None if self.linear is None else self.linear.angle(x)
        if linear is not None:
            both = both + self.linear_share * (linear - both)
        return (*both.tolist(), spread)
