"""The interface of the classifier's linear part."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from typing import ClassVar

from robot.learner.base import Vector
from robot.learner.part import Stateful
from robot.learner.votes import Floats

N_CONTEXTS = 2
EVERY = range(N_CONTEXTS)
Angle = Floats | float
"""An angle and its magnitude, shape (2,); 0 if no angle is learned."""


class LinearPart(Stateful, ABC):
    """A linear score per label, learned one frame at a time."""

    knows_contexts: ClassVar[bool] = False
    n_features: int
    """Number of leading values of a vector that are used."""

    @abstractmethod
    def add_label(self) -> None:
        """Add a label that no earlier frame had."""

    def begin_angles(self, of_labels: Floats) -> None:
        """Also learn an angle from now on; each earlier frame gets the angle of its label."""

    @abstractmethod
    def scores(self, x: Vector, context: int | None = None) -> Floats:
        """Return each label's estimated probability, shape (n_labels,), not limited to [0, 1]."""

    def angle(self, x: Vector) -> Floats | None:
        """Return angle and magnitude, shape (2,), without limits; None if no angle is learned."""
        return None

    @abstractmethod
    def learn(
        self, x: Vector, targets: Floats, angle: Angle = 0.0, contexts: Collection[int] = EVERY
    ) -> None:
        """Add a frame with target scores, shape (n_labels,), which counts only in `contexts`."""

    @abstractmethod
    def forget(self, x: Vector, targets: Floats, frames: float, angle: Angle = 0.0) -> None:
        """Remove `frames` frames that have these means; each context loses its share of them."""

    @abstractmethod
    def retarget(self, x: Vector, change: Floats, angle: Angle = 0.0) -> None:
        """Add `change`, shape (n_labels,), to the summed targets of frames whose mean is `x`."""
