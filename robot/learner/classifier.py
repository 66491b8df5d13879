"""Labels on top of the clustering: each node counts the labels of the frames that it stands for."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import NDArray

from robot.learner import votes
from robot.learner.base import Evidence, Label, NotFittedError, State, Vector
from robot.learner.bsoc import BSOC, Merge
from robot.learner.published import PublishedBSOC

GROUP_COST = 1000.0
"""Merging nodes of two labels is this many times dearer: in practice the last resort."""
N_VOTERS = 3


class BSOCClassifier:
    """A classifier of at most `max_nodes` learned images.

    Args:
        max_nodes: How many images to keep at most.
        group_cost: How many times dearer a merge of two labels is; 1 as published.
        n_voters: How many of the nearest nodes vote.
        cluster: The clustering; a label-aware `BSOC` unless given.

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
        cluster: BSOC | PublishedBSOC | None = None,
    ) -> None:
        if n_voters < 1:
            raise ValueError(f"n_voters must be at least 1, not {n_voters}")
        self.max_nodes = max_nodes
        self.n_voters = n_voters
        self.cluster = BSOC(max_nodes, group_cost=group_cost) if cluster is None else cluster
        self.labels_: list[Label] = []
        self.n_seen_ = 0
        self.last_node_: int | None = None
        self._histograms = np.zeros((max_nodes, 0), np.int64)

    @classmethod
    def published(cls, max_nodes: int = 32, *, integer: bool = False) -> Self:
        """Return the paper's classifier: the nearest node's most counted label."""
        cluster = PublishedBSOC(max_nodes, integer=integer)
        return cls(max_nodes, n_voters=1, cluster=cluster)

    @property
    def histograms_(self) -> NDArray[np.int64]:
        """Labels counted per node, shape (n, len(labels_))."""
        return self._histograms[: len(self.cluster)].copy()

    def learn_one(self, x: Vector, y: Label) -> None:
        """Add one labelled frame; merge two nodes when over `max_nodes`.

        Raises:
            ValueError: If `x` or `y` cannot be learned; the learner is then unchanged.
        """
        if not isinstance(y, str) or not y:
            raise ValueError(f"a label is a word, not {y!r}")
        known = y in self.labels_
        column = self.labels_.index(y) if known else len(self.labels_)
        node = self.cluster.train(x, column)
        if not known:
            self.labels_.append(y)
            new = np.zeros((self.max_nodes, 1), np.int64)
            self._histograms = np.hstack([self._histograms, new])
        if self.cluster.last_merge_ is not None:
            self._follow(self.cluster.last_merge_)
        self._histograms[node, column] += 1
        self.n_seen_ += 1
        self.last_node_ = node

    def predict_one(self, x: Vector) -> Label:
        """Return the label with most votes, the first learned on a tie.

        Raises:
            NotFittedError: Before the first lesson.
            ValueError: If `x` is of another shape or not finite.
        """
        return self.labels_[int(self._votes(x)[1].argmax())]

    def predict_proba_one(self, x: Vector) -> dict[Label, float]:
        """Return each known label's share; raises as `predict_one`."""
        return dict(zip(self.labels_, self._votes(x)[1].tolist(), strict=True))

    def explain_one(self, x: Vector) -> Evidence:
        """Return the prediction and the node it rests on; raises as `predict_one`."""
        distances, shares = self._votes(x)
        node = int(distances.argmin())
        best = int(shares.argmax())
        return Evidence(
            label=self.labels_[best],
            probabilities=dict(zip(self.labels_, shares.tolist(), strict=True)),
            confidence=float(shares[best]),
            node=node,
            distance=float(distances[node]),
        )

    def _votes(self, x: Vector) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if not self.labels_:
            raise NotFittedError("nothing was learned yet")
        distances = self.cluster.distances(x)
        histograms = self._histograms[: len(self.cluster)]
        if self.n_voters == 1:
            return distances, votes.majority(distances, histograms)
        return distances, votes.nearest_nodes(distances, histograms, self.n_voters)

    def _follow(self, merge: Merge) -> None:
        self._histograms[merge.kept] += self._histograms[merge.removed]
        self._histograms[merge.removed] = 0

    def get_state(self) -> State:
        """Return a copy of all that was learned."""
        inner = self.cluster.get_state()
        params = {"n_voters": self.n_voters, "n_seen": self.n_seen_, "cluster": inner.params}
        arrays = {f"cluster_{name}": array for name, array in inner.arrays.items()}
        arrays["histograms"] = self._histograms.copy()
        return State(
            kind=f"classifier:{inner.kind}",
            params=params,
            arrays=arrays,
            labels=list(self.labels_),
        )

    def set_state(self, state: State) -> None:
        """Become the classifier that gave `state`; raises ValueError if it is of another kind."""
        kind = f"classifier:{self.cluster.get_state().kind}"
        if state.kind != kind:
            raise ValueError(f"the model is a {state.kind}, not a {kind}")
        prefix = "cluster_"
        inner = {k[len(prefix) :]: v for k, v in state.arrays.items() if k.startswith(prefix)}
        self.cluster.set_state(
            State(kind=kind.partition(":")[2], params=state.params["cluster"], arrays=inner)
        )
        self.max_nodes = self.cluster.max_nodes
        self.n_voters = int(state.params["n_voters"])
        self.n_seen_ = int(state.params["n_seen"])
        self.labels_ = list(state.labels)
        self._histograms = state.arrays["histograms"].copy()

    def relabel_node(self, node_id: int, y: Label) -> None:
        """Let the node of this id vote for `y` alone; raises LookupError if there is none."""
        index = self._index(node_id)
        if y not in self.labels_:
            self.labels_.append(y)
            new = np.zeros((self.max_nodes, 1), np.int64)
            self._histograms = np.hstack([self._histograms, new])
        column = self.labels_.index(y)
        total = int(self._histograms[index].sum())
        self._histograms[index] = 0
        self._histograms[index, column] = max(total, 1)
        self.cluster.set_group(index, column)

    def delete_node(self, node_id: int) -> None:
        """Forget the node of this id; raises LookupError if there is none."""
        index = self._index(node_id)
        last = self.cluster.delete(index)
        self._histograms[index] = self._histograms[last]
        self._histograms[last] = 0

    def pin_node(self, node_id: int, pinned: bool = True) -> None:
        """Keep the node of this id as it is: never merged, never deleted."""
        self.cluster.pin(self._index(node_id), pinned)

    def _index(self, node_id: int) -> int:
        found = np.flatnonzero(self.cluster.ids_ == node_id)
        if found.size == 0:
            raise LookupError(f"there is no node {node_id}")
        return int(found[0])
