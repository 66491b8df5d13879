"""Online ridge regression from features to labels: exact after every frame, without a matrix solve.

Source: recursive least squares, Haykin, "Adaptive Filter Theory", with a forgetting factor of 1.
After any number of frames the weights are those of batch ridge regression on all of them.

The inverse is large, and writing it is what a frame would cost. So its last few changes wait as
vectors, which count as if they were in it, and are written together: three times as fast.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_WAITING = 8
"""So many changes of the inverse are written at once; those that wait have a gain."""


class LinearPart(Protocol):
    """A linear score per label, learned one frame at a time."""

    def add_label(self) -> None:
        """Add a label, which no frame so far had."""
        ...

    def scores(self, x: NDArray[Any]) -> Floats:
        """Return one score a label, about its probability but not bounded, shape (n_labels,)."""
        ...

    def learn(self, x: NDArray[Any], targets: Floats, weight: float = 1.0) -> None:
        """Add a frame with its target scores `weight` times; a negative weight takes it back."""
        ...

    def retarget(self, x: NDArray[Any], change: Floats) -> None:
        """Change the targets of frames of mean `x` by `change` in sum; the frames stay."""
        ...

    def get_arrays(self) -> dict[str, NDArray[Any]]:
        """Return copies of all that was learned."""
        ...

    def set_arrays(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Restore what `get_arrays` returned; raises ValueError if it had other features."""
        ...


class RecursiveRidge:
    """A linear score per label, from the first `n_features` values of a vector.

    Time and memory O(n_features ** 2), whatever the number of frames seen.

    Args:
        n_features: How many values are used; a constant is added to them.
        penalty: Weight of the squared coefficients.
        scale: What the values are divided by, so that they lie about in [0, 1].
    """

    def __init__(self, n_features: int, *, penalty: float = 3.0, scale: float = 255.0) -> None:
        if n_features < 1 or penalty <= 0.0 or scale <= 0.0:
            raise ValueError("n_features, penalty and scale must be above 0")
        self.n_features = n_features
        self.scale = scale
        size = n_features + 1
        self._inverse = np.eye(size) / penalty
        self._weights = np.zeros((size, 0))
        self._work = np.zeros((size, size))
        self._directions = np.zeros((_WAITING, size))
        self._gains = np.zeros(_WAITING)
        self._n_waiting = 0

    def add_label(self) -> None:
        """Add a column for a new label, which no frame so far had."""
        self._weights = np.hstack([self._weights, np.zeros((len(self._weights), 1))])

    def scores(self, x: NDArray[Any]) -> Floats:
        """Return one score a label, about its probability but not bounded, shape (n_labels,)."""
        scores: Floats = self.scaled(x) @ self._weights
        return scores

    def learn(self, x: NDArray[Any], targets: Floats, weight: float = 1.0) -> None:
        """Add a frame with its target scores `weight` times; a negative weight takes it back."""
        self.learn_scaled(self.scaled(x), targets, weight)

    def learn_scaled(self, z: Floats, targets: Floats, weight: float = 1.0) -> None:
        """Do as `learn` with what `scaled` returned: ridges of one kind need it once."""
        direction = self._solve(z)
        gain = weight / (1.0 + weight * float(z @ direction))
        error = targets - z @ self._weights
        self._weights += (gain * direction)[:, None] * error
        self._directions[self._n_waiting] = direction
        self._gains[self._n_waiting] = gain
        self._n_waiting += 1
        if self._n_waiting == _WAITING:
            np.matmul(self._directions.T, self._gains[:, None] * self._directions, out=self._work)
            self._inverse -= self._work
            self._directions[:], self._gains[:] = 0.0, 0.0
            self._n_waiting = 0

    def retarget(self, x: NDArray[Any], change: Floats) -> None:
        """Change the targets of frames of mean `x` by `change` in sum; the frames stay."""
        self._weights += np.outer(self._solve(self.scaled(x)), change)

    def _solve(self, z: Floats) -> Floats:
        """Return the inverse times `z`, with the changes that wait."""
        waiting = slice(self._n_waiting)
        directions, gains = self._directions[waiting], self._gains[waiting]
        solution: Floats = self._inverse @ z - (gains * (directions @ z)) @ directions
        return solution

    def scaled(self, x: NDArray[Any]) -> Floats:
        """Return the values that are used, scaled, and the constant; shape (n_features + 1,)."""
        z = np.ones(self.n_features + 1)
        np.divide(x[: self.n_features], self.scale, out=z[:-1])
        return z

    def get_arrays(self) -> dict[str, NDArray[Any]]:
        """Return copies of all that was learned."""
        return {
            "inverse": self._inverse.copy(),
            "linear": self._weights.copy(),
            "directions": self._directions.copy(),
            "gains": self._gains.copy(),
        }

    def set_arrays(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Restore what `get_arrays` returned; raises ValueError if it had other features."""
        if arrays["inverse"].shape != self._inverse.shape:
            raise ValueError("the model was learned on another number of features")
        self._inverse = arrays["inverse"].copy()
        self._weights = arrays["linear"].copy()
        # Older models have none.
        self._directions = arrays.get("directions", np.zeros_like(self._directions)).copy()
        self._gains = arrays.get("gains", np.zeros_like(self._gains)).copy()
        self._n_waiting = int(np.count_nonzero(self._gains))
