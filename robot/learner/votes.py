"""Judges a view by its distances from the learned images: its label, its angle, its novelty."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import Array, Stateful

Floats = NDArray[np.float64]
Distances = NDArray[np.float32] | NDArray[np.float64]


def nearest_nodes(distances: Distances, histograms: NDArray[np.int64], n_voters: int) -> Floats:
    """Return the labels' shares among the `n_voters` nearest nodes, the nearer the heavier.

    With one voter this is the paper's vote.

    Args:
        distances: Squared distances to the nodes, shape (n,).
        histograms: Labels counted per node, shape (n, n_labels).
        n_voters: How many nodes vote at most.

    Returns:
        Shares that sum to 1, shape (n_labels,).
    """
    if n_voters == 1:
        return shares(histograms[int(distances.argmin())].astype(np.float64))
    voters, weights = _weighed(distances, histograms, n_voters)
    summed = [0.0] * histograms.shape[1]  # of a few numbers: no task for numpy
    for weight, counts in zip(weights, histograms[voters].tolist(), strict=True):
        each = weight / max(sum(counts), 1)
        summed = [votes + each * count for votes, count in zip(summed, counts, strict=True)]
    return shares(np.array(summed))


def _weighed(
    distances: Distances, counts: NDArray[np.int64], n_voters: int
) -> tuple[NDArray[np.intp], list[float]]:
    """Return the `n_voters` nearest nodes, and how heavy each is: the nearer the heavier."""
    voters = np.arange(distances.size)
    if distances.size > n_voters:
        voters = distances.argpartition(n_voters - 1)[:n_voters]
        if not counts[voters].any():  # of images that are the same one has all the votes
            voting = np.unique(counts.nonzero()[0])
            voters = voting[distances[voting].argsort()[:n_voters]]
    near = distances[voters].tolist()
    least = 1e-3 * max(near, default=0.0)
    return voters, [1.0 / (distance + least + 1e-12) for distance in near]


def angle_terms(angle: Floats | float) -> Floats:
    """Return angle, size and square, shape (..., 3): their sums give all that is said of angles."""
    return np.stack([angle, np.abs(angle), np.square(angle)], axis=-1)


def mean_angle(
    distances: Distances, sums: Floats, frames: NDArray[np.int64], n_voters: int
) -> tuple[Floats, float]:
    """Return mean angle and size, shape (2,), and the angle's deviation among the nearest nodes.

    Args:
        distances: Squared distances to the nodes, shape (n,).
        sums: Sums of each node's `angle_terms`, shape (n or more, 3).
        frames: How many frames each node stands for, shape (n,).
        n_voters: How many nodes count at most, the nearer the more.
    """
    voters, each = _weighed(distances, frames, n_voters)
    weights = np.array(each) * (frames[voters] > 0)
    shares = weights / ((weights.sum() or 1.0) * np.maximum(frames[voters], 1))
    means: Floats = shares @ sums[voters]
    return means[:2], math.sqrt(max(float(means[2] - means[0] ** 2), 0.0))


def chance(votes: Sequence[float], best: int, sharpness: float) -> float:
    """Return the chance that the label `best` is right: its share after sharpening.

    Votes of neighbours and of a penalised linear part are underconfident: at 75 % they are right in
    87 % of frames. Raising shares to a power (a temperature below 1) corrects that at every level.
    """
    powers = [vote**sharpness for vote in votes]  # of a few numbers: no task for numpy
    total = sum(powers)
    return powers[best] / total if total > 0 else 0.0


def rarity(counts: NDArray[np.int64] | Floats, power: float) -> Floats:
    """Return what to multiply each label's votes by, so that a rare one weighs more.

    A few examples show mostly the most frequent label, and whatever was learned from them leans
    towards it: "logit adjustment", Menon et al. (2021).

    Args:
        counts: How many examples each label has.
        power: Of a label's frequency; with 1 frequencies no longer count.
    """
    weights: Floats = (np.maximum(counts, 1) / max(float(counts.sum()), 1.0)) ** -power
    return weights


def shares(votes: Floats) -> Floats:
    """Return `votes` divided by their sum; equal shares if there are none."""
    total = float(votes.sum())
    return votes / total if total > 0 else np.full(votes.size, 1.0 / max(votes.size, 1))


HELD_OUT = 20
"""Number of latest examples whose nodes are left out when the novelty of the next one is measured:
frames a tenth of a second apart are almost the same. At ten examples a second this is 2 s."""
_FEWEST, _MEMORY = 30, 600
"""The least and the largest number of latest examples that a view is compared with."""
_SCALE = 3
_RENEWED_EVERY = 20
_BORDER = 98
MARGIN = 0.05
"""Share of the median by which the border of novelty lies beyond the percentile `_BORDER`."""


class Novelty(Stateful):
    """Compares a view's distance with those of earlier examples.

    Every example, before it is learned, has a distance from the nearest node that none of the
    latest examples went into. Such distances occur when the robot comes by again. The
    median of these is novelty 0, a little beyond their 98th percentile 1. Old examples count less,
    because distances shrink as the nodes cover the place.

    Args:
        margin: Share of the median by which the border lies beyond that percentile.
    """

    fields = (
        Array("novelty", np.float64, (range(_SCALE, 100_000),), high=1e12, attribute="_kept"),
    )

    def __init__(self, *, margin: float = MARGIN) -> None:
        self.margin = margin
        self.lengths: deque[float] = deque(maxlen=_MEMORY)
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


def percentile(ordered: Sequence[float], share: float) -> float:
    """Return what `numpy.percentile` does for values in order, to the last bit.

    That function costs a brick more than a frame, and newer versions import masked arrays for it.
    """
    place = share / 100 * (len(ordered) - 1)
    index = min(int(place), len(ordered) - 2)
    low, high, rest = ordered[index], ordered[index + 1], place - index
    # From the nearer end, so that it never leaves the two.
    return high - (high - low) * (1 - rest) if rest >= 0.5 else low + (high - low) * rest
