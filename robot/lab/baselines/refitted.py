"""Learners that keep every frame and are fitted anew when asked after an example."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.lab.baselines.wrapped import Baseline, Floats, from_library
from robot.learner.base import Vector
from robot.learner.part import Value
from robot.learner.values import count


class Refitted(Baseline):
    """A scikit-learn classifier behind the learner's interface.

    Memory and time grow with every example.
    """

    fields = (*Baseline.fields, Value("n_neighbours", count(), "number", is_fixed=True))

    def _make(self) -> Any:
        """Return a new classifier with `fit` and `predict_proba`."""
        raise NotImplementedError

    def _count_to_fit(self, n_examples: int) -> int:
        """Return to how many of the examples, from the first, it is to be fitted."""
        return n_examples

    def _forget(self) -> None:
        self._model: Any = None
        self._n_fitted = 0

    def _prepare(self, x: Vector) -> Floats:
        return x.astype(np.float32)

    def _learn(self, x: Floats, column: int) -> None:
        """Wait until it is asked."""

    def _shares(self, x: Floats) -> Floats:
        wanted = self._count_to_fit(len(self._xs))
        if self._n_fitted != wanted:
            self._model = self._make()
            self._model.fit(self._prepare(np.stack(self._xs[:wanted])), self._ys[:wanted])
            self._n_fitted = wanted
        self.labels_ = [str(label) for label in self._model.classes_]
        shares: Floats = self._model.predict_proba(x[None, :])[0]
        return shares


class NearestNeighbours(Refitted):
    """k nearest neighbours: the learner that keeps every frame."""

    kind = "knn"

    def __init__(self, number: int) -> None:
        self._classifier = from_library(
            "sklearn.neighbors", "KNeighborsClassifier", "knn", "evaluate"
        )
        super().__init__(number)

    def _make(self) -> Any:
        return self._classifier(min(self.number, len(self._xs)), algorithm="brute")


class ExtraTrees(Refitted):
    """Extremely randomized trees (Geurts and others, 2006): a strong batch learner."""

    kind = "trees"

    def __init__(self, number: int) -> None:
        self._classifier = from_library(
            "sklearn.ensemble", "ExtraTreesClassifier", "trees", "evaluate"
        )
        super().__init__(number)

    def _make(self) -> Any:
        return self._classifier(self.number, random_state=0, min_samples_leaf=2)
