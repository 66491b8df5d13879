"""How unlike all that was learned a view is, compared with the distances of earlier examples."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import Array, Arrays, Params, Stateful
from robot.learner.values import count, number, row

HELD_OUT = 20
"""A node that one of so many latest examples went into says nothing about how new the next one is:
frames a tenth of a second apart are almost the same. At ten examples a second this is 2 s."""
_FEWEST = 30
_SCALE = 3
_RENEWED_EVERY = 20
_BORDER = 98
MARGIN = 0.05
"""The border lies beyond that percentile by so much of the median."""


class Novelty(Stateful):
    """Compares a view's distance with those of earlier examples.

    Every example, before it is learned, has a distance from the nearest node that none of the
    latest examples went into. Such distances occur when the robot comes by again. The
    median of these is novelty 0, a little beyond their 98th percentile 1. Old examples count less,
    because distances shrink as the nodes cover the place.

    Args:
        memory: How many of the latest examples it compares with.
        margin: By how much of the median the border lies beyond that percentile.
    """

    fields = (
        Array("novelty", np.float64, (range(_SCALE, 100_000),), high=1e12, attribute="_kept"),
    )

    def __init__(self, *, memory: int = 600, margin: float = MARGIN) -> None:
        self.margin = margin
        self.lengths: deque[float] = deque(maxlen=memory)
        self._median = self._border = 0.0
        self._n_new = 0

    def learn(self, squared_distance: float) -> None:
        """Add the distance of one example from the nearest node without recent examples."""
        self.lengths.append(math.sqrt(squared_distance))
        self._n_new += 1
        if self._n_new >= _RENEWED_EVERY and len(self.lengths) >= _FEWEST:
            self._renew()

    def _renew(self) -> None:
        self._n_new = 0
        ordered = sorted(self.lengths)
        self._median, self._border = percentile(ordered, 50), percentile(ordered, _BORDER)
        self._border += self.margin * self._median

    def score(self, squared_distance: float) -> float:
        """Return 0 for a view no farther away than usual, 1 at the limit, more beyond."""
        span = self._border - self._median
        if span <= 0.0:
            return 0.0
        return max(0.0, (math.sqrt(squared_distance) - self._median) / span)

    @property
    def _kept(self) -> NDArray[np.float64]:
        """The scale and the distances, oldest first."""
        return np.array([self._median, self._border, self._n_new, *self.lengths])

    @_kept.setter
    def _kept(self, values: NDArray[np.float64]) -> None:
        self._median, self._border, n_new = values[:_SCALE].tolist()
        self._n_new = int(n_new)
        self.lengths.clear()
        self.lengths.extend(values[_SCALE:].tolist())

    def upgrade(self, params: Params, arrays: Arrays) -> None:
        """Make an approximate scale of the mean and variance that version 0.1 kept."""
        if "novelty" in params:
            n, mean, variance = row(count(), number(0.0), number(0.0))(params.pop("novelty"), {})
            border = mean + 4.0 * math.sqrt(variance) + self.margin * mean
            lengths = [mean] * min(n, self.lengths.maxlen or 0)
            arrays["novelty"] = np.array([mean, border, 0.0, *lengths])


def percentile(ordered: Sequence[float], share: float) -> float:
    """Return what `numpy.percentile` does for values in order, to the last bit.

    That function costs a brick more than a frame, and newer versions import masked arrays for it.
    """
    place = share / 100 * (len(ordered) - 1)
    index = min(int(place), len(ordered) - 2)
    low, high, rest = ordered[index], ordered[index + 1], place - index
    # From the nearer end, so that it never leaves the two.
    return high - (high - low) * (1 - rest) if rest >= 0.5 else low + (high - low) * rest
