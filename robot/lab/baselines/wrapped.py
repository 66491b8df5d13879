"""What all baselines share: labels in the order they came, checks, and a state by relearning."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import need
from robot.learner.base import (
    BaseLearner,
    Evidence,
    Label,
    NotFittedError,
    State,
    Vector,
    checked_vector,
)
from robot.learner.part import Array, Stateful, Value

Floats = NDArray[np.float64]
_DTYPES = (np.uint8, np.float32, np.float64)
CLASSES = np.arange(16)
"""Numbers of labels, for libraries that want to know all of them at the first example."""


def from_library(module: str, name: str, learner: str, extra: str = "learners") -> Any:
    """Return a class of a library, which is imported only now.

    Raises:
        MissingExtraError: If it is not installed.
    """
    return getattr(need(module, f"the learner {learner}", extra), name)


class Baseline(Stateful, BaseLearner):
    """A learner from a library behind the learner's interface, for comparison and for teaching.

    Its state is its examples: `set_state` learns them again, which gives the same learner because
    every baseline is seeded. Memory therefore grows with the examples.

    Args:
        number: What the learner's name says: of neighbours, cells, units ...
    """

    kind: str
    fields: Sequence[Value | Array] = (
        Array("xs", _DTYPES, ("n_examples", "d"), -1e6, 1e6, may_miss=True),
    )

    def __init__(self, number: int) -> None:
        self.number = number
        self.labels_: list[Label] = []
        self._xs: list[Vector] = []
        self._ys: list[Label] = []
        self._forget()

    def learn_one(self, x: Vector, y: Label) -> None:
        """Learn one labelled vector; raises ValueError on bad input, and is then unchanged."""
        if not isinstance(y, str) or not y:
            raise ValueError(f"a label must be a string, not {y!r}")
        array = checked_vector(x, self._xs[0].size if self._xs else None)
        if y not in self.labels_:
            self.labels_.append(y)
        self._xs.append(array.copy())
        self._ys.append(str(y))
        self._learn(self._prepare(array), self.labels_.index(y))

    def explain_one(self, x: Vector) -> Evidence:
        if not self._xs:
            raise NotFittedError("nothing was learned yet")
        shares = self._shares(self._prepare(checked_vector(x, self._xs[0].size)))
        best = int(shares.argmax())
        return Evidence(
            label=self.labels_[best],
            probabilities=dict(zip(self.labels_, shares.tolist(), strict=True)),
            confidence=float(shares[best]),
        )

    def _prepare(self, x: Vector) -> Floats:
        """Return the vector as it is learned: values in [-1, 1]."""
        return x.astype(np.float64) / 127.5 - 1.0

    @abstractmethod
    def _learn(self, x: Floats, column: int) -> None:
        """Learn a prepared vector, with the number of its label."""

    @abstractmethod
    def _shares(self, x: Floats) -> Floats:
        """Return a share for each of `labels_`, summing to 1."""

    @abstractmethod
    def _forget(self) -> None:
        """Become as new."""

    @property
    def n_examples(self) -> int:
        """How many examples it keeps."""
        return len(self._ys)

    def get_state(self) -> State:
        params, arrays = self.save()
        return State(kind=self.kind, params=params, arrays=arrays, labels=list(self._ys))

    def set_state(self, state: State) -> None:
        """Learn again what `state` holds; raises ValueError if it is of another kind."""
        if state.kind != self.kind:
            raise ValueError(f"the model is a {state.kind}, not a {self.kind}")
        self._ys = list(map(str, state.labels))
        self.load(state.params, state.arrays)
        xs = () if self._xs is None else self._xs
        examples = list(zip(xs, self._ys, strict=True))
        self.labels_, self._xs, self._ys = [], [], []
        self._forget()
        for x, y in examples:
            self.learn_one(x, y)
