"""A small neural network with a replay buffer, after ALVINN (Pomerleau 1991).

A rotating set of 200 images; each frame enters as 15 variations of itself, shifted sideways, and
takes the places of those whose removal keeps the labels most even; then one pass over the set.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.lab.baselines.wrapped import CLASSES, Baseline, Floats, from_library
from robot.learner.votes import shares
from robot.policy.features import THUMBNAIL_WIDTH

SET_SIZE, N_VARIATIONS, MAX_SHIFT = 200, 15, 2


def _even(x: Floats) -> Floats:
    """Return a picture of mean 0 and spread 1: what all pictures share would drown the units."""
    centred = x - x.mean()
    even: Floats = centred / max(float(centred.std()), 0.02)
    return even


class ReplayNetwork(Baseline):
    """scikit-learn's perceptron with one hidden layer, taught from a rotating set.

    Vectors are grey pictures of `width` columns, so that a variation is a shifted picture. The
    shifts are small enough to keep their label: ALVINN also corrected the steering of larger ones,
    which labels without an angle do not allow.
    """

    kind = "alvinn"

    def __init__(self, number: int, *, width: int = THUMBNAIL_WIDTH) -> None:
        self._width = width
        super().__init__(number)

    def _forget(self) -> None:
        make = from_library("sklearn.neural_network", "MLPClassifier", self.kind)
        self._rng = np.random.default_rng(0)
        self._images: list[Floats] = []
        self._columns: list[int] = []
        self._model: Any = make(
            (self.number,),
            activation="tanh",
            learning_rate_init=0.001,
            batch_size=15,
            random_state=0,
        )

    def _learn(self, x: Floats, column: int) -> None:
        picture = _even(x).reshape(-1, self._width)
        for _ in range(N_VARIATIONS):
            shift = int(self._rng.integers(-MAX_SHIFT, MAX_SHIFT + 1))
            columns = (np.arange(self._width) + shift).clip(0, self._width - 1)
            self._insert(picture[:, columns].ravel(), column)
        self._model.partial_fit(np.stack(self._images), self._columns, classes=CLASSES)

    def _insert(self, image: Floats, column: int) -> None:
        if len(self._images) >= SET_SIZE:
            counts = np.bincount(self._columns)
            fullest = np.flatnonzero(np.array(self._columns) == counts.argmax())
            gone = int(self._rng.choice(fullest))
            del self._images[gone], self._columns[gone]
        self._images.append(image)
        self._columns.append(column)

    def _shares(self, x: Floats) -> Floats:
        chances: Floats = self._model.predict_proba(_even(x)[None, :])[0, : len(self.labels_)]
        return shares(chances)
