"""Computes a view's label, angle and novelty from its distances to the learned images.

A label that the pilot has replaced at a view loses votes there (`ChangeOfMind`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import Array, Stateful, Value
from robot.learner.values import WHOLE, count

_DOUBT = 0.5
"""Rate at which confidence falls as novelty rises above 1. At novelty 3, half of it is left."""
Floats = NDArray[np.float64]
Distances = NDArray[np.float32] | NDArray[np.float64]


def nearest_nodes(distances: Distances, histograms: NDArray[np.int64], n_voters: int) -> Floats:
    """Return each label's share of a k-nearest-neighbour vote, in which nearer nodes weigh more.

    With one voter, the nearest node decides, as in the paper.

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
        if not counts[voters].any():  # if several images are equal, only one of them has counts
            voting = np.unique(counts.nonzero()[0])
            voters = voting[distances[voting].argsort()[:n_voters]]
    near = distances[voters].tolist()
    least = 1e-3 * max(near, default=0.0)
    return voters, [1.0 / (distance + least + 1e-12) for distance in near]


def angle_terms(angle: Floats | float) -> Floats:
    """Return the angle, its magnitude and its square, shape (..., 3). The sums of these terms give
    the mean and the standard deviation of several angles."""
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
    """Return the probability that the label `best` is right: its share of the votes, sharpened.

    Votes of neighbours and of a penalised linear part are underconfident: at a share of 75 % they
    are right in 87 % of frames. Raising the shares to a power (temperature scaling) calibrates the
    probabilities.
    """
    powers = [vote**sharpness for vote in votes]  # for few numbers a list is faster than numpy
    total = sum(powers)
    return powers[best] / total if total > 0 else 0.0


def doubted(votes: Sequence[float], best: int, sharpness: float, novelty: float) -> float:
    """Return `chance`. As novelty rises above 1, the result approaches that of a random guess."""
    certain = chance(votes, best, sharpness)
    if novelty <= 1.0:
        return certain
    guess = 1.0 / sum(vote > 0.0 for vote in votes)
    return guess + (certain - guess) / (1.0 + _DOUBT * (novelty - 1.0))


def rarity(counts: NDArray[np.int64] | Floats, power: float) -> Floats:
    """Return a factor for each label's votes, shape (n_labels,), higher for rare labels.

    Most of the first examples have the most frequent label, so a learner trained on them is biased
    towards this label. The factors reduce this bias ("logit adjustment", Menon et al. 2021).

    Args:
        counts: Number of examples of each label; without examples the factor is 1.
        power: Exponent of a label's frequency; 1 cancels the effect of the frequencies.
    """
    shown = np.where(counts > 0, counts / max(float(counts.sum()), 1.0), 1.0)
    weights: Floats = shown**-power
    return weights


def shares(votes: Floats) -> Floats:
    """Return `votes` divided by their sum, shape (n_labels,). If all are 0, return equal shares."""
    total = float(votes.sum())
    return votes / total if total > 0 else np.full(votes.size, 1.0 / max(votes.size, 1))


HELD_OUT = 20
"""Novelty ignores the nodes of this many latest examples, because successive frames are almost the
same. At ten examples a second, these examples cover 2 s."""
_FEWEST, _MEMORY = 30, 600
"""Minimum and maximum number of earlier distances with which a view's distance is compared."""
_SCALE = 3
_RENEWED_EVERY = 20
_BORDER = 98
MARGIN = 0.05
"""Novelty 1 is the percentile `_BORDER` of the distances plus `MARGIN` times their median."""


class Novelty(Stateful):
    """Compares a view's distance with those of earlier examples.

    Before the learner learns an example, it measures the example's distance from the nearest node,
    except nodes with one of the latest examples. These distances are typical of places that the
    robot passes again. Novelty is 0 at their median, and 1 a little above their 98th percentile.
    Only the latest distances count, because distances shrink as nodes cover more of the place.

    Args:
        margin: Share of the median that is added to the percentile; see `MARGIN`.
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
        """Add an example's distance from the nearest node without one of the latest examples."""
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
        """Return 0 at the usual distance, 1 at the border of novelty, and more beyond it."""
        span = self._border - self._median
        if span <= 0.0:
            return 0.0
        return max(0.0, (math.sqrt(squared_distance) - self._median) / span)

    @property
    def _kept(self) -> NDArray[np.float64]:
        """The saved state: median, border, number of new distances, and the distances."""
        return np.array([self._median, self._border, self._n_new, *self.lengths])

    @_kept.setter
    def _kept(self, values: NDArray[np.float64]) -> None:
        self._median, self._border, n_new = values[:_SCALE].tolist()
        self._n_new = int(n_new)
        self.lengths.clear()
        self.lengths.extend(values[_SCALE:].tolist())


def percentile(ordered: Sequence[float], share: float) -> float:
    """Return exactly the result of `numpy.percentile`, for sorted values.

    `numpy.percentile` takes longer than a frame on a slow machine, and imports masked arrays.
    """
    place = share / 100 * (len(ordered) - 1)
    index = min(int(place), len(ordered) - 2)
    low, high, rest = ordered[index], ordered[index + 1], place - index
    # Interpolate from the nearer end, so that the result stays between `low` and `high`.
    return high - (high - low) * (1 - rest) if rest >= 0.5 else low + (high - low) * rest


CLEARLY = 0.9
"""An image is clearly nearer than another if its distance is at most this share of the other's."""
APART = 1.3
"""An example differs clearly from another label if the distance to that label's images is at least
this many times the distance to the images of its own label."""
ENOUGH = 20.0
"""A label is overruled if at least this many more examples contradict it than confirm it."""
MOST_A_TURN = 10.0
"""A single turn, which may be a mistake, adds at most this many examples against a label."""
CONFIRMED = 4.0
"""If a label is taught again at a view where it was taught before, the example cancels this many
contradictions."""
LATER = 200
"""An image was taught "much later" than another if at least this many examples were learned in
between (20 s of teaching)."""
STILL_VALID = 0.3
"""Share of an overruled label's votes that remains."""


class ChangeOfMind(Stateful):
    """Detects that the pilot has changed his mind and relabels the same views again and again.

    If the pilot stops using a label, this does not prove a change of mind: perhaps he has only
    turned around to drive back. A single contradiction does not prove a change of mind either,
    because a view where a turn begins can be labelled as straight in one lap and as a turn in the
    next. So an example contradicts another label only if that label's images are about as near as
    the images of the example's own label, and clearly nearer than those of the usual label. After a
    change of mind, most examples contradict the old label; on a drive back, few examples do.

    A label loses most of its votes at a view if it was contradicted often enough, and its nearest
    image was last taught before the contradictions began. The label also loses these votes if
    another label's image is at least as near and was taught much later. Only the counting of votes
    changes; the stored histograms do not. So teaching the old label again at the same views cancels
    the effect.

    The pilot can also declare a change of mind (`outdate`), which is better evidence than
    contradictions. If a label's nearest image was last taught before `outdate`, most of the label's
    votes go to the nearest image that was taught afterwards.

    The usual label, to which the pilot switches most often, is never contradicted. It is mostly
    FORWARD: a pilot returns to it after every other label, but not always at the same view.

    Labels are column numbers, and times are counts of examples. Arrays of shape (n,) describe the
    images. `distances` are squared. `owners` are the labels with the most votes, or -1 if there are
    no votes. `taught` is the time of each image's latest example.
    """

    fields = (
        Array("contradicted", np.float64, ("n_labels+1", "n_labels")),
        Array("contradicted_since", np.int64, ("n_labels", "n_labels"), 0, WHOLE, "_since"),
        Array("taken_up", np.int64, ("n_labels+1",), 0, WHOLE, "_kept_taken_up"),
        Value("outdated_before", count()),
    )

    def __init__(self) -> None:
        self._against = np.zeros((0, 0))  # [a, b]: examples of label b that contradict label a
        self._since = np.zeros((0, 0), np.int64)
        self._taken_up = np.zeros(0, np.int64)
        self._last = -1
        self._outdated_before = 0
        self._before = np.zeros(0)  # the evidence against each label when the current label began

    def add_label(self) -> None:
        """Make room for one more label."""
        self._against = np.pad(self._against, (0, 1))
        self._since = np.pad(self._since, (0, 1))
        self._taken_up = np.append(self._taken_up, 0)
        self._before = np.append(self._before, 0.0)

    def note(
        self,
        label: int,
        distances: Distances,
        owners: NDArray[np.int64],
        taught: NDArray[np.int64],
        now: int,
    ) -> None:
        """Update the evidence with one example, taught at time `now`."""
        if label != self._last:
            self._taken_up[label] += 1
            self._before, self._last = self._against[:, label].copy(), label
        usual = int(self._taken_up.argmax())
        if label == usual:
            return
        near = distances < CLEARLY**2 * distances[owners == usual].min(initial=np.inf)
        apart = APART**2 * distances[owners == label].min(initial=np.inf)
        others = [other for other in range(len(self._taken_up)) if other not in (label, usual)]
        for old in others:
            if not self._against[old, label]:
                self._since[old, label] = now
            images = near & (distances < apart)
            images &= (owners == old) & (taught < self._since[old, label])
            most = min(self._before[old] + MOST_A_TURN, 2 * ENOUGH)
            now_against = self._against[old, label] + (1.0 if images.any() else -1.0)
            self._against[old, label] = min(max(now_against, 0.0), most)
        for new in others:
            if (near & (owners == label) & (taught < self._since[label, new])).any():
                self._against[label, new] = max(self._against[label, new] - CONFIRMED, 0.0)

    def outdate(self, now: int) -> None:
        """Give more weight to examples from the time `now` on than to all earlier examples."""
        self._outdated_before = now

    def applied(
        self,
        shares: Floats,
        distances: Distances,
        owners: NDArray[np.int64],
        taught: NDArray[np.int64],
    ) -> Floats:
        """Return each label's share of the votes, shape (n_labels,), corrected for relabelling."""
        usual = int(self._taken_up.argmax())
        nearest: dict[int, tuple[float, int]] = {}  # by label: (distance, time taught)
        for label in range(len(shares)):
            if label != usual:
                image = int(np.where(owners == label, distances, np.inf).argmin())
                if owners[image] == label:
                    nearest[label] = float(distances[image]), int(taught[image])
        if len(nearest) < 2:
            return shares
        after = shares.copy()
        for old, (distance, old_s) in nearest.items():
            followers = [
                (other, new)
                for new, (other, new_s) in nearest.items()
                if (self._against[old, new] >= ENOUGH and old_s < self._since[old, new])
                or old_s < self._outdated_before <= new_s
                or (other <= distance and new_s > old_s + LATER)
            ]
            if followers:
                passed = (1.0 - STILL_VALID) * shares[old]
                after[old] -= passed
                after[min(followers)[1]] += passed
        return after

    @property
    def _contradicted(self) -> Floats:
        """The evidence against each label, then the evidence when the current label began."""
        return np.vstack([self._against, self._before])

    @_contradicted.setter
    def _contradicted(self, against: Floats) -> None:
        self._against, self._before = against[:-1], against[-1]

    @property
    def _kept_taken_up(self) -> NDArray[np.int64]:
        """The saved state: how often each label began, then the last label's column + 1, or 0."""
        return np.append(self._taken_up, self._last + 1)

    @_kept_taken_up.setter
    def _kept_taken_up(self, taken_up: NDArray[np.int64]) -> None:
        self._taken_up, self._last = taken_up[:-1], int(taken_up[-1]) - 1

    def faults(self) -> Iterator[str]:
        if self._last >= len(self._taken_up):
            yield "the last label does not exist"
