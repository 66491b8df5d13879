"""Learners that keep every frame and are fitted anew when asked after an example."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.errors import MissingExtraError
from robot.learner.base import (
    BaseLearner,
    Evidence,
    Label,
    NotFittedError,
    State,
    Vector,
    checked_vector,
)


class Refitted(BaseLearner):
    """A scikit-learn classifier behind the learner's interface.

    Memory and time grow with every example.
    """

    kind: str

    def __init__(self, number: int) -> None:
        self.number = number
        self._model: Any = None
        self._n_fitted = 0
        self._xs: list[Vector] = []
        self._ys: list[Label] = []

    def _make(self) -> Any:
        """Return a new classifier with `fit` and `predict_proba`."""
        raise NotImplementedError

    def _count_to_fit(self, n_examples: int) -> int:
        """Return to how many of the examples, from the first, it is to be fitted."""
        return n_examples

    def learn_one(self, x: Vector, y: Label) -> None:
        """Keep one labelled vector."""
        if not isinstance(y, str) or not y:
            raise ValueError(f"a label must be a string, not {y!r}")
        self._xs.append(checked_vector(x, self._xs[0].size if self._xs else None).copy())
        self._ys.append(str(y))

    def explain_one(self, x: Vector) -> Evidence:
        """Return the prediction with its shares."""
        if not self._xs:
            raise NotFittedError("nothing was learned yet")
        row = checked_vector(x, self._xs[0].size)[None, :].astype(np.float32)
        wanted = self._count_to_fit(len(self._xs))
        if self._n_fitted != wanted:
            self._model = self._make()
            self._model.fit(np.stack(self._xs[:wanted]).astype(np.float32), self._ys[:wanted])
            self._n_fitted = wanted
        shares = self._model.predict_proba(row)[0].tolist()
        labels = [str(label) for label in self._model.classes_]
        best = int(np.argmax(shares))
        return Evidence(
            label=labels[best],
            probabilities=dict(zip(labels, shares, strict=True)),
            confidence=shares[best],
        )

    def get_state(self) -> State:
        """Return a copy of all frames kept."""
        arrays = {"xs": np.stack(self._xs)} if self._xs else {}
        params = {"n_neighbours": self.number}
        return State(kind=self.kind, params=params, arrays=arrays, labels=list(self._ys))

    def set_state(self, state: State) -> None:
        """Become the learner that gave `state`; raises ValueError if it is of another kind."""
        if state.kind != self.kind:
            raise ValueError(f"the model is a {state.kind}, not a {self.kind}")
        self.number = int(state.params["n_neighbours"])
        self._xs = list(state.arrays["xs"].copy()) if state.labels else []
        self._ys = list(state.labels)
        self._model, self._n_fitted = None, 0


class NearestNeighbours(Refitted):
    """k nearest neighbours: the learner that keeps every frame."""

    kind = "knn"

    def __init__(self, n_neighbours: int) -> None:
        if n_neighbours < 1:
            raise ValueError(f"n_neighbours must be at least 1, not {n_neighbours}")
        super().__init__(n_neighbours)
        try:
            from sklearn.neighbors import KNeighborsClassifier
        except ImportError as error:
            raise MissingExtraError("the learner knn", "evaluate") from error
        self._classifier: Any = KNeighborsClassifier

    def _make(self) -> Any:
        return self._classifier(min(self.number, len(self._xs)), algorithm="brute")


class ExtraTrees(Refitted):
    """Extremely randomized trees (Geurts and others, 2006): a strong batch learner."""

    kind = "trees"

    def __init__(self, n_trees: int) -> None:
        super().__init__(n_trees)
        try:
            from sklearn.ensemble import ExtraTreesClassifier
        except ImportError as error:
            raise MissingExtraError("the learner trees", "evaluate") from error
        self._classifier: Any = ExtraTreesClassifier

    def _make(self) -> Any:
        return self._classifier(self.number, random_state=0, min_samples_leaf=2)
