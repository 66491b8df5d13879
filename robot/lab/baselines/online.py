"""Online learners of scikit-learn and river, a frame at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.lab.baselines.wrapped import CLASSES, Baseline, Floats, from_library
from robot.learner.votes import shares


class LinearOnline(Baseline):
    """scikit-learn's logistic regression by stochastic gradient descent."""

    kind = "sgd"

    def _forget(self) -> None:
        make = from_library("sklearn.linear_model", "SGDClassifier", self.kind)
        self._model: Any = make(loss="log_loss", alpha=1e-3, random_state=0)

    def _learn(self, x: Floats, column: int) -> None:
        self._model.partial_fit(x[None, :], [column], classes=CLASSES)

    def _shares(self, x: Floats) -> Floats:
        scores = self._model.decision_function(x[None, :])[0, : len(self.labels_)]
        powers = np.exp(scores - scores.max())
        return shares(powers)


class RiverSoftmax(Baseline):
    """river's softmax regression."""

    kind = "river"

    def _forget(self) -> None:
        self._model: Any = from_library("river.linear_model", "SoftmaxRegression", self.kind)()

    def _learn(self, x: Floats, column: int) -> None:
        self._model.learn_one(dict(enumerate(x.tolist())), column)

    def _shares(self, x: Floats) -> Floats:
        chances = self._model.predict_proba_one(dict(enumerate(x.tolist())))
        return shares(np.array([chances.get(i, 0.0) for i in range(len(self.labels_))]))
