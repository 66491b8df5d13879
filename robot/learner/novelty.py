"""How unlike all that was learned a view is, measured by the learner's own history."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

HELD_OUT = 20
"""A node that one of so many latest examples went into says nothing about how new the next one is:
frames a tenth of a second apart are almost the same. At ten examples a second this is 2 s."""
_FEWEST = 30
_RENEWED_EVERY = 20
_BORDER = 98


class Novelty:
    """Compares a view's distance with those at which earlier examples came in.

    Every example, before it is learned, lies at some distance from the nearest node that none of
    the latest examples went into: a distance as the robot will meet it when it comes by again. The
    median of these is novelty 0, a little beyond their 98th percentile 1. Old examples fade, for
    nodes come nearer as they spread over the place.

    Args:
        memory: How many examples it looks back on.
    """

    def __init__(self, *, memory: int = 600) -> None:
        self.lengths: deque[float] = deque(maxlen=memory)
        self._median = self._border = 0.0
        self._n_new = 0

    def learn(self, squared_distance: float) -> None:
        """Take in the distance of one example from the nearest node that is held against it."""
        self.lengths.append(math.sqrt(squared_distance))
        self._n_new += 1
        if self._n_new >= _RENEWED_EVERY and len(self.lengths) >= _FEWEST:
            self._renew()

    def _renew(self) -> None:
        self._n_new = 0
        self._median, self._border = np.percentile(self.lengths, (50, _BORDER)).tolist()
        self._border += 0.05 * self._median

    def score(self, squared_distance: float) -> float:
        """Return 0 for a view no farther than usual, 1 at the border, more beyond."""
        span = self._border - self._median
        if span <= 0.0:
            return 0.0
        return max(0.0, (math.sqrt(squared_distance) - self._median) / span)

    def get_array(self) -> NDArray[np.float64]:
        """Return the scale and the distances, oldest first."""
        return np.array([self._median, self._border, self._n_new, *self.lengths])

    def set_array(self, values: NDArray[np.float64]) -> None:
        """Become what gave `values`."""
        self._median, self._border = float(values[0]), float(values[1])
        self._n_new = int(values[2])
        self.lengths.clear()
        self.lengths.extend(values[3:].tolist())

    def set_moments(self, n: int, mean: float, variance: float) -> None:
        """Become one of about this scale: models of version 0.1 keep mean and variance alone."""
        self.lengths.clear()
        self.lengths.extend([mean] * min(int(n), self.lengths.maxlen or 0))
        self._median, self._border = mean, mean + 4.0 * math.sqrt(variance) + 0.05 * mean
