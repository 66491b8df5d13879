"""What every learner can do, whatever it is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[Any]
"""A feature vector of shape (d,): float32 or uint8, finite, the same d on every call."""

Label = str
"""A class. Labels are plain strings; an enum whose members are strings will do."""


class NotFittedError(ValueError):
    """A prediction was asked of a learner that has learned nothing."""


def checked_vector(x: Vector, n_features: int | None = None) -> Vector:
    """Return `x` as an array, or refuse it.

    Raises:
        ValueError: If `x` is not a non-empty, finite vector of numbers, or has not
            `n_features` values.
    """
    array = np.asarray(x)
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"a feature vector has one dimension and some values, not {array.shape}")
    if array.dtype.kind not in "fiub":
        raise ValueError(f"a feature vector holds numbers, not {array.dtype}")
    if n_features is not None and array.size != n_features:
        raise ValueError(f"the vector has {array.size} values, learned were {n_features}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError("the vector holds values that are not finite")
    return array


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """A prediction together with what it rests on.

    `probabilities` sum to 1. `confidence` is a calibrated chance that `label` is right.
    `novelty` is 0 for a familiar view; 1 or more means: unlike all that was learned.
    `node` is the nearest learned image (None where the learner has no such thing).
    """

    label: Label
    probabilities: Mapping[Label, float]
    confidence: float
    novelty: float = 0.0
    node: int | None = None
    distance: float = 0.0


@dataclass(slots=True)
class State:
    """All that a learner knows, as arrays and plain values: what is saved, sent and compared."""

    kind: str
    params: dict[str, Any]
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    labels: list[Label] = field(default_factory=list)


@runtime_checkable
class Learner(Protocol):
    """One frame at a time: learn it, or say what it is."""

    def learn_one(self, x: Vector, y: Label) -> None:
        """Add one labelled vector. Refuses bad input with ValueError and is then unchanged."""
        ...

    def predict_one(self, x: Vector) -> Label:
        """Return the most likely label. Raises NotFittedError before the first lesson."""
        ...

    def predict_proba_one(self, x: Vector) -> dict[Label, float]:
        """Return each known label's share; shares sum to 1."""
        ...

    def explain_one(self, x: Vector) -> Evidence:
        """Return the prediction with its evidence."""
        ...

    def get_state(self) -> State:
        """Return a copy of all that was learned; `set_state` of it changes no prediction."""
        ...

    def set_state(self, state: State) -> None:
        """Become the learner that gave `state`. Raises ValueError if it is of another kind."""
        ...


__all__ = ["Evidence", "Label", "Learner", "NotFittedError", "State", "Vector", "checked_vector"]
