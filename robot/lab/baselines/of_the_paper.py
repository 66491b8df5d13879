"""The learners with which the paper compares its learner BSOC: a self-organizing map, a neural gas,
and ALVINN.

Sources: Kohonen (1982) through MiniSom; Fritzke (1995) through MiniGNG; Pomerleau, "Efficient
Training of Artificial Neural Networks for Autonomous Navigation" (1991) on scikit-learn's network.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.policy.features import THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH

Images = NDArray[Any]


class Prototypes:
    """A classifier on top of a clustering: each image predicts the labels of its nearest examples.

    Args:
        cluster: Trains a net on the given frames, once each and in order; returns the net's
            images, shape (n, d).
    """

    def __init__(self, cluster: Callable[[Images], Images]) -> None:
        self._cluster = cluster

    def fit(self, xs: Images, ys: Sequence[str]) -> None:
        self.classes_, columns = np.unique(np.asarray(ys), return_inverse=True)
        self._images = self._cluster(xs)
        counts = np.zeros((len(self._images), len(self.classes_)))
        np.add.at(counts, (self._nearest(xs), columns), 1.0)
        has_votes = counts.any(axis=1)
        self._images, counts = self._images[has_votes], counts[has_votes]
        self._shares = counts / counts.sum(axis=1, keepdims=True)

    def predict_proba(self, xs: Images) -> Images:
        shares: Images = self._shares[self._nearest(xs)]
        return shares

    def _nearest(self, xs: Images) -> NDArray[np.intp]:
        norms = 0.5 * np.einsum("ij,ij->i", self._images, self._images)
        nearest: NDArray[np.intp] = (norms - xs @ self._images.T).argmin(axis=1)
        return nearest


def som(make: Any, number: int, n_examples: int) -> Prototypes:
    """Return a self-organizing map of about `number` images, as nearly square as possible."""
    rows = math.isqrt(number)

    def cluster(xs: Images) -> Images:
        net = make(rows, number // rows, xs.shape[1], sigma=0.5 + rows / 4, random_seed=0)
        net.random_weights_init(xs)
        net.train(xs, len(xs), random_order=False)
        return np.asarray(net.get_weights()).reshape(-1, xs.shape[1])

    return Prototypes(cluster)


def gng(make: Any, number: int, n_examples: int) -> Prototypes:
    """Return a growing neural gas. During the fit, the gas adds prototypes at regular intervals,
    until it has `number` of them."""

    def cluster(xs: Images) -> Images:
        every = max(len(xs) // number, 1)
        net = make(n_epochs=1, sigma=every, max_units=number, shuffle=False)
        # repeat the last frame: growing neural gas needs at least two
        net.fit(np.vstack([xs, xs[-1:]]).astype(np.float64))
        return np.stack([unit.prototype for unit in net.units])

    return Prototypes(cluster)


KEPT, SHIFTS = 200, [shift for shift in range(-7, 8) if shift]
"""ALVINN's training set contains `KEPT` pictures. Each frame, which is 40 pixels wide, is added
together with copies that are shifted sideways by `SHIFTS` pixels."""


class RotatingSet:
    """ALVINN: after each frame, makes one pass over a set of recent frames and shifted copies.

    Args:
        network: A scikit-learn network that has `partial_fit`.
    """

    def __init__(self, network: Any) -> None:
        self._network = network

    def fit(self, xs: Images, ys: Sequence[str]) -> None:
        self.classes_ = np.unique(np.asarray(ys))
        rng, kept, labels = (
            np.random.default_rng(0),
            np.zeros((0, xs.shape[1])),
            np.zeros(KEPT, int),
        )
        for x, y in zip(xs / 255.0, ys, strict=True):
            picture = np.pad(x.reshape(THUMBNAIL_HEIGHT, -1), ((0, 0), (7, 7)), "edge")
            new = [picture[:, 7 + s : 7 + s + THUMBNAIL_WIDTH].ravel() for s in [0, *SHIFTS]]
            places = np.arange(len(kept), min(len(kept) + len(new), KEPT))
            kept = np.vstack([kept, np.zeros((len(places), xs.shape[1]))])
            rest = rng.choice(len(kept), len(new) - len(places), replace=False)
            places = np.append(places, rest).astype(int)
            kept[places] = new
            labels[places] = np.searchsorted(self.classes_, y)
            told = self.classes_[labels[: len(kept)]]
            self._network.partial_fit(kept, told, classes=self.classes_)

    def predict_proba(self, xs: Images) -> Images:
        # for one class, the network would return two probabilities
        if len(self.classes_) == 1:
            return np.ones((len(xs), 1))
        shares: Images = self._network.predict_proba(xs / 255.0)
        return shares
