"""Online learners of scikit-learn and river, a frame at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.errors import MissingExtraError
from robot.lab.baselines.wrapped import Baseline, Floats
from robot.learner.votes import shares

_CLASSES = np.arange(16)


class LinearOnline(Baseline):
    """scikit-learn's logistic regression by stochastic gradient descent."""

    kind = "sgd"

    def __init__(self) -> None:
        super().__init__()
        try:
            from sklearn.linear_model import SGDClassifier
        except ImportError as error:
            raise MissingExtraError("the learner sgd", "learners") from error
        self._make: Any = SGDClassifier
        self._forget()

    def _forget(self) -> None:
        self._model: Any = self._make(loss="log_loss", alpha=1e-3, random_state=0)

    def _learn(self, x: Floats, column: int) -> None:
        self._model.partial_fit(x[None, :], [column], classes=_CLASSES)

    def _shares(self, x: Floats) -> Floats:
        scores = self._model.decision_function(x[None, :])[0, : len(self.labels_)]
        powers = np.exp(scores - scores.max())
        return shares(powers)


class RiverSoftmax(Baseline):
    """river's softmax regression."""

    kind = "river"

    def __init__(self) -> None:
        super().__init__()
        try:
            from river import linear_model
        except ImportError as error:
            raise MissingExtraError("the learner river", "learners") from error
        self._make: Any = linear_model.SoftmaxRegression
        self._forget()

    def _forget(self) -> None:
        self._model: Any = self._make()

    def _learn(self, x: Floats, column: int) -> None:
        self._model.learn_one(dict(enumerate(x.tolist())), column)

    def _shares(self, x: Floats) -> Floats:
        chances = self._model.predict_proba_one(dict(enumerate(x.tolist())))
        return shares(np.array([chances.get(i, 0.0) for i in range(len(self.labels_))]))
