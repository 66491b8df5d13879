"""Judges a view by its distances from the learned images: its label, its angle, its novelty."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import Array, Stateful

_DOUBT = 0.5
"""How fast confidence falls with novelty above 1: at novelty 3 half of the confidence is left."""
Floats = NDArray[np.float64]
Distances = NDArray[np.float32] | NDArray[np.float64]


def nearest_nodes(distances: Distances, histograms: NDArray[np.int64], n_voters: int) -> Floats:
    """Return the labels' shares among the `n_voters` nearest nodes, weighted by nearness.

    With one voter this is the paper's vote.

    Args:
        distances: Squared distances to the nodes, shape (n,).
        histograms: Labels counted per node, shape (n, n_labels).
        n_voters: Maximum number of nodes that vote.

    Returns:
        Shares that sum to 1, shape (n_labels,).
    """
    if n_voters == 1:
        return shares(histograms[int(distances.argmin())].astype(np.float64))
    voters, weights = _weighed(distances, histograms, n_voters)
    summed = [0.0] * histograms.shape[1]  # for few numbers a list is faster than numpy
    for weight, counts in zip(weights, histograms[voters].tolist(), strict=True):
        each = weight / max(sum(counts), 1)
        summed = [votes + each * count for votes, count in zip(summed, counts, strict=True)]
    return shares(np.array(summed))


def _weighed(
    distances: Distances, counts: NDArray[np.int64], n_voters: int
) -> tuple[NDArray[np.intp], list[float]]:
    """Return the `n_voters` nearest nodes and their weights; nearer nodes have higher weights."""
    voters = np.arange(distances.size)
    if distances.size > n_voters:
        voters = distances.argpartition(n_voters - 1)[:n_voters]
        if not counts[voters].any():  # if several images are equal, only one of them has votes
            voting = np.unique(counts.nonzero()[0])
            voters = voting[distances[voting].argsort()[:n_voters]]
    near = distances[voters].tolist()
    least = 1e-3 * max(near, default=0.0)
    return voters, [1.0 / (distance + least + 1e-12) for distance in near]


def angle_terms(angle: Floats | float) -> Floats:
    """Return angle, magnitude and square, shape (..., 3): means and deviations of angles are
    computed from sums of these terms."""
    return np.stack([angle, np.abs(angle), np.square(angle)], axis=-1)


def mean_angle(
    distances: Distances, sums: Floats, frames: NDArray[np.int64], n_voters: int
) -> tuple[Floats, float]:
    """Return the mean angle and magnitude, shape (2,), and the angle's standard deviation.

    Args:
        distances: Squared distances to the nodes, shape (n,).
        sums: Sums of each node's `angle_terms`, shape (n or more, 3).
        frames: Number of frames of each node, shape (n,).
        n_voters: Maximum number of nodes that count, weighted by nearness.
    """
    voters, each = _weighed(distances, frames, n_voters)
    weights = np.array(each) * (frames[voters] > 0)
    shares = weights / ((weights.sum() or 1.0) * np.maximum(frames[voters], 1))
    means: Floats = shares @ sums[voters]
    return means[:2], math.sqrt(max(float(means[2] - means[0] ** 2), 0.0))


def chance(votes: Sequence[float], best: int, sharpness: float) -> float:
    """Return the probability that the label `best` is right: its share after sharpening.

    Votes of neighbours and of a penalised linear part are underconfident: at a share of 75 % they
    are right in 87 % of frames. Raising shares to a power (a temperature below 1) corrects this at
    every level.
    """
    powers = [vote**sharpness for vote in votes]  # for few numbers a list is faster than numpy
    total = sum(powers)
    return powers[best] / total if total > 0 else 0.0


def doubted(votes: Sequence[float], best: int, sharpness: float, novelty: float) -> float:
    """Return `chance`, lower on an unknown view, where it is near a guess's."""
    certain = chance(votes, best, sharpness)
    if novelty <= 1.0:
        return certain
    guess = 1.0 / sum(vote > 0.0 for vote in votes)
    return guess + (certain - guess) / (1.0 + _DOUBT * (novelty - 1.0))


def rarity(counts: NDArray[np.int64] | Floats, power: float) -> Floats:
    """Return factors for the labels' votes, higher for rare labels.

    Most of the first examples have the most frequent label, so a learner trained on them is biased
    towards this label. The factors correct this ("logit adjustment", Menon et al. 2021).

    Args:
        counts: Number of examples of each label; without examples the factor is 1.
        power: Exponent of a label's frequency; 1 cancels the effect of the frequencies.
    """
    shown = np.where(counts > 0, counts / max(float(counts.sum()), 1.0), 1.0)
    weights: Floats = shown**-power
    return weights


def shares(votes: Floats) -> Floats:
    """Return `votes` divided by their sum; equal shares if there are none."""
    total = float(votes.sum())
    return votes / total if total > 0 else np.full(votes.size, 1.0 / max(votes.size, 1))


HELD_OUT = 20
"""Number of the latest examples whose nodes are left out when the next example's novelty is
measured, because successive frames are almost the same. At ten examples a second this is 2 s."""
_FEWEST, _MEMORY = 30, 600
"""The least and the largest number of examples with which a view is compared, the latest ones."""
_SCALE = 3
_RENEWED_EVERY = 20
_BORDER = 98
MARGIN = 0.05
"""The border of novelty is the percentile `_BORDER` plus this share of the median."""


class Novelty(Stateful):
    """Compares a view's distance with those of earlier examples.

    Before an example is learned, its distance from the nearest node without recent examples is
    measured. Such distances are typical when the robot passes a place again. Their median is
    novelty 0; a little more than their 98th percentile is novelty 1. Old examples count less,
    because distances shrink as the nodes cover the surroundings.

    Args:
        margin: Share of the median by which the border lies beyond the percentile.
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
        """Add an example's distance from the nearest node without recent examples."""
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
        """Return 0 for a view that is as near as usual, 1 at the border of novelty, more beyond
        it."""
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
    """Return exactly the result of `numpy.percentile`, for sorted values.

    On a brick `numpy.percentile` takes longer than a frame, and newer versions of numpy import
    masked arrays for it.
    """
    place = share / 100 * (len(ordered) - 1)
    index = min(int(place), len(ordered) - 2)
    low, high, rest = ordered[index], ordered[index + 1], place - index
    # Interpolate from the nearer end, so that the result stays between `low` and `high`.
    return high - (high - low) * (1 - rest) if rest >= 0.5 else low + (high - low) * rest
