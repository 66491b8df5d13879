"""A classifier of another library behind the learner's interface: it keeps every frame, and is
fitted anew when asked after an example."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

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
from robot.learner.values import count


class Baseline(Stateful, BaseLearner):
    """A learner of another library, for comparison and for teaching.

    Its state is its examples: the same ones give the same learner, because every classifier is
    seeded. Memory and time grow with every example.

    Args:
        kind: What it is called in a model.
        number: What its name says: of neighbours, trees, units ...
        make: Returns a new classifier with `fit`, `predict_proba` and `classes_`, given how many
            examples there are.
        is_eager: It is fitted to every example; else with each tenth part more of them.
    """

    _dtypes = (np.uint8, np.float32, np.float64)
    fields: tuple[Array | Value, ...] = (
        Array("xs", _dtypes, ("n_examples", "d"), -1e6, 1e6, may_miss=True),
        Value("n_neighbours", count(), "number", is_fixed=True),
    )

    def __init__(
        self, kind: str, number: int, make: Callable[[int], Any], *, is_eager: bool = True
    ) -> None:
        self.kind, self.number = kind, number
        self._make, self._is_eager = make, is_eager
        self._xs: list[Vector] = []
        self._ys: list[Label] = []
        self._model: Any = None
        self._n_fitted = 0

    def learn_one(self, x: Vector, y: Label) -> None:
        """Learn one labelled vector; raises ValueError on bad input, and is then unchanged."""
        if not isinstance(y, str) or not y:
            raise ValueError(f"a label must be a string, not {y!r}")
        array = checked_vector(x, self._xs[0].size if self._xs else None)
        self._xs.append(array.copy())
        self._ys.append(str(y))

    def explain_one(self, x: Vector) -> Evidence:
        model, vector = self._fitted(x)
        shares = model.predict_proba(vector)[0].tolist()
        probabilities = dict(zip(map(str, model.classes_), shares, strict=True))
        best = max(probabilities, key=probabilities.__getitem__)
        return Evidence(label=best, probabilities=probabilities, confidence=probabilities[best])

    def _fitted(self, x: Vector) -> tuple[Any, Any]:
        """Return the model of all examples, and the vector as it takes it."""
        if not self._xs:
            raise NotFittedError("nothing was learned yet")
        array = checked_vector(x, self._xs[0].size)
        wanted = len(self._xs) if self._is_eager else _tenth_parts(len(self._xs))
        if self._n_fitted != wanted:
            model = self._make(wanted)
            model.fit(np.stack(self._xs[:wanted]).astype(np.float32), self._targets()[:wanted])
            self._model, self._n_fitted = model, wanted
        return self._model, array.astype(np.float32)[None, :]

    def _targets(self) -> Any:
        return self._ys

    @property
    def n_examples(self) -> int:
        """How many examples it keeps."""
        return len(self._ys)

    def get_state(self) -> State:
        params, arrays = self.save()
        return State(kind=self.kind, params=params, arrays=arrays, labels=list(self._ys))

    def set_state(self, state: State) -> None:
        """Keep the examples of `state` alone; raises ValueError if it is of another kind."""
        if state.kind != self.kind:
            raise ValueError(f"the model is a {state.kind}, not a {self.kind}")
        self._ys = list(map(str, state.labels))
        self.load(state.params, state.arrays)
        self._xs = [] if self._xs is None else list(self._xs)
        if len(self._xs) != len(self._ys):
            raise ValueError("the array xs is missing, of which there are labels")
        self._model, self._n_fitted = None, 0


def _tenth_parts(n_examples: int) -> int:
    """Return the largest of 1, 2, ... 10, 11, 12 ... 20, 22 ... that is not more than this."""
    count = 1
    while (following := count + max(1, count // 10)) <= n_examples:
        count = following
    return count
