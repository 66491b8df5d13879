"""Wraps a classifier of another library in the interface of a learner. The learner stores every
example. Before a prediction, it fits the classifier again if there are new examples."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from robot.learner.base import (
    Abilities,
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
from robot.moves import CLASSIC, side_of
from robot.policy.policy import Policy
from robot.types import Point, Prediction


class Baseline(Stateful, BaseLearner):
    """A learner of another library, for comparison and for teaching.

    The learner's state is its examples. Learners with equal examples are equal, because every
    classifier has a fixed seed. Memory and time grow with every example.

    Args:
        kind: The learner's name in a model.
        number: The number in the learner's name, for example of neighbours or trees.
        make: Returns a new classifier with `fit`, `predict_proba` and `classes_`, given the number
            of examples.
        is_eager: True if the learner is fitted again after every example; False if only whenever
            the number of examples has grown by a tenth.
    """

    _dtypes = (np.uint8, np.float32, np.float64)
    fields: tuple[Array | Value, ...] = (
        Array("xs", _dtypes, ("n_examples", "d"), -1e6, 1e6, is_optional=True),
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
        """Learn one labelled vector. Raises ValueError, and learns nothing, for invalid input."""
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
        """Return the classifier fitted to all examples, and `x` in the form that it expects."""
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
        """Number of stored examples."""
        return len(self._ys)

    def get_state(self) -> State:
        params, arrays = self.save()
        return State(kind=self.kind, params=params, arrays=arrays, labels=list(self._ys))

    def set_state(self, state: State) -> None:
        """Replace all examples by those of `state`; raises ValueError if `state` is of another
        kind."""
        if state.kind != self.kind:
            raise ValueError(f"the model is a {state.kind}, not a {self.kind}")
        self._ys = list(map(str, state.labels))
        self.load(state.params, state.arrays)
        self._xs = [] if self._xs is None else list(self._xs)
        if len(self._xs) != len(self._ys):
            raise ValueError("the array xs is missing, but there are labels")
        self._model, self._n_fitted = None, 0


def _tenth_parts(n_examples: int) -> int:
    """Return the number of examples at which the classifier was last fitted. The classifier is
    fitted at each of the first 20 examples, and later whenever the number of examples has grown by
    a tenth: at 22, 24 ... 30, 33 and so on."""
    count = 1
    while (following := count + max(1, count // 10)) <= n_examples:
        count = following
    return count


class AngleBaseline(Baseline):
    """Wraps a regression model of another library. The model learns steering angles instead of
    labels."""

    abilities = Abilities(angles=True)
    fields = (
        *Baseline.fields,
        Array(
            "baseline_angles", np.float64, ("n_examples",), -1.0, 1.0, "_angles", is_optional=True
        ),
    )

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._of_labels = {str(n): move.steering or 0.0 for n, move in CLASSIC.items()}
        self._angles: list[float] = []

    def begin_angles(self, of_labels: Mapping[Label, float]) -> None:
        self._of_labels.update(of_labels)

    def learn_one(self, x: Vector, y: Label) -> None:
        self.learn_in(x, y, ())

    def learn_in(
        self, x: Vector, y: Label, contexts: Collection[int], angle: float | None = None
    ) -> None:
        super().learn_one(x, y)
        self._angles.append(self._of_labels.get(y, 0.0) if angle is None else angle)

    def explain_one(self, x: Vector) -> Evidence:
        model, vector = self._fitted(x)
        angle = float(np.clip(model.predict(vector), -1.0, 1.0)[0])
        known = {y: self._of_labels.get(y, 0.0) for y in sorted(set(self._ys))}
        side = side_of(angle)
        best = min(known, key=lambda y: (side_of(known[y]) != side, abs(known[y] - angle)))
        shares = {y: float(y == best) for y in known}
        return Evidence(
            label=best, probabilities=shares, confidence=1.0, angle=angle, size=abs(angle)
        )

    def set_state(self, state: State) -> None:
        super().set_state(state)
        self._angles = [] if self._angles is None else list(self._angles)

    def _targets(self) -> Any:
        return self._angles


class AnglePolicy(Policy):
    """A policy that steers by the angle that the learner predicts, and not by the pilot's usual
    angle for the move."""

    def propose(self, frame_id: int, x: Vector, **seen: Any) -> Prediction:
        said, angle = super().propose(frame_id, x, **seen), self._degrees.angle
        if said.point is None or angle is None:
            return said
        return replace(said, point=Point(angle, said.point.throttle))
