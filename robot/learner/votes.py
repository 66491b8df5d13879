"""Votes on a view's label, from the labels and distances of the learned images near it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Distances = NDArray[np.float32] | NDArray[np.float64]


def majority(distances: Distances, histograms: NDArray[np.int64]) -> Floats:
    """Return the nearest node's shares of labels, shape (n_labels,): the paper's vote."""
    votes = histograms[int(distances.argmin())].astype(np.float64)
    return shares(votes)


def nearest_nodes(distances: Distances, histograms: NDArray[np.int64], n_voters: int) -> Floats:
    """Return the labels' shares among the `n_voters` nearest nodes, the nearer the heavier.

    Args:
        distances: Squared distances to the nodes, shape (n,).
        histograms: Labels counted per node, shape (n, n_labels).
        n_voters: How many nodes vote at most.

    Returns:
        Shares that sum to 1, shape (n_labels,).
    """
    voters, weights = weighed(distances, n_voters)
    counts = histograms[voters]
    totals = np.maximum(counts.sum(axis=1), 1)
    return shares((weights / totals) @ counts)


def weighed(distances: Distances, n_voters: int) -> tuple[NDArray[np.intp], Floats]:
    """Return the `n_voters` nearest nodes, and how heavy each is: the nearer the heavier."""
    if distances.size > n_voters:
        voters = np.argpartition(distances, n_voters - 1)[:n_voters]
    else:
        voters = np.arange(distances.size)
    near = distances[voters]
    return voters, 1.0 / (near.astype(np.float64) + 1e-3 * float(near.max()) + 1e-12)


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
    voters, weights = weighed(distances, n_voters)
    shares = weights / (weights.sum() * np.maximum(frames[voters], 1))
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


def rarity(counts: NDArray[np.int64], power: float) -> Floats:
    """Return what to multiply each label's votes by, so that a rare one weighs more.

    A few examples show mostly the most frequent label, and whatever was learned from them leans
    towards it: "logit adjustment", Menon et al. (2021).

    Args:
        counts: How many examples each label has.
        power: Of a label's frequency; with 1 frequencies no longer count.
    """
    weights: Floats = (np.maximum(counts, 1) / max(int(counts.sum()), 1)) ** -power
    return weights


def shares(votes: Floats) -> Floats:
    """Return `votes` divided by their sum; equal shares if there are none."""
    total = float(votes.sum())
    return votes / total if total > 0 else np.full(votes.size, 1.0 / max(votes.size, 1))
