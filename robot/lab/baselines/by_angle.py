"""Rivals by degrees: they regress the angle alone, and their move is the one that it counts as."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from robot.driver import CLASSIC, side_of
from robot.lab.baselines.baseline import Baseline
from robot.learner.base import Abilities, Evidence, Label, State, Vector
from robot.learner.part import Array
from robot.policy.policy import Policy
from robot.types import Point, Prediction


class AngleBaseline(Baseline):
    """A regression of another library on the angle; it learns no labels, but knows their angles."""

    abilities = Abilities(angles=True)
    fields = (
        *Baseline.fields,
        Array("baseline_angles", np.float64, ("n_examples",), -1.0, 1.0, "_angles", may_miss=True),
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
    """Steers as its learner says, whatever the pilot means by the move."""

    def propose(self, frame_id: int, x: Vector, **seen: Any) -> Prediction:
        said, angle = super().propose(frame_id, x, **seen), self._degrees.angle
        if said.point is None or angle is None:
            return said
        return replace(said, point=Point(angle, said.point.throttle))
