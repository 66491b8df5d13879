"""How unlike all that was learned a view is, measured by the learner's own history."""

from __future__ import annotations

import math


class Novelty:
    """Compares a view's distance with those at which earlier lessons came in.

    Every lesson, before it is learned, lies at some distance from the nearest node: mean and
    spread of these say what is usual. A view is novel (1 or more) from `n_sigmas` above the mean.
    Old lessons fade, for nodes come nearer as they spread over the place.

    Args:
        n_sigmas: How many standard deviations above the mean a view counts as novel.
        memory: About how many lessons the statistics look back on.
    """

    def __init__(self, *, n_sigmas: float = 4.0, memory: int = 300) -> None:
        self.n_sigmas = n_sigmas
        self.memory = memory
        self.n = 0
        self.mean = 0.0
        self.variance = 0.0

    def learn(self, squared_distance: float) -> None:
        """Take in the distance of one lesson from the nearest node before it."""
        length = math.sqrt(squared_distance)
        self.n += 1
        share = 1.0 / min(self.n, self.memory)
        step = length - self.mean
        self.mean += share * step
        self.variance = (1.0 - share) * (self.variance + share * step * step)

    def score(self, squared_distance: float) -> float:
        """Return 0 for a view no farther than usual, 1 at the border, more beyond."""
        border = self.n_sigmas * math.sqrt(self.variance) + 0.05 * self.mean
        if self.n < 10 or border <= 0.0:
            return 0.0
        return max(0.0, (math.sqrt(squared_distance) - self.mean) / border)
