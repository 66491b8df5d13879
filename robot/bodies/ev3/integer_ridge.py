"""Online ridge regression in whole numbers, for processors without a floating-point unit.

Source: Zakharov, White and Liu, "Low-complexity RLS algorithms using dichotomous coordinate descent
iterations" (IEEE Transactions on Signal Processing, 2008). Each frame is added to the normal
equations. A few steps of coordinate descent then improve the approximate solution. This module
differs from the paper in one point: each step sets one weight to the value with the least error,
rounded to a whole number.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.learner.linear import EVERY, Angle, LinearPart
from robot.learner.part import Array
from robot.learner.values import WHOLE
from robot.learner.votes import Floats

_ONE = 1 << 24
"""Fixed-point value of the score 1, which is the target for a frame's own label."""
_SHIFT = 2
"""Number of low bits that are dropped from each value, so that a value takes six bits and a product
of two values twelve bits."""
_TOP = 63
_FULL = 1 << 30
"""Upper bound of a sum of products. When a sum reaches it, which takes seven hours of teaching at
ten frames a second, all sums are halved."""
_MOST_HALVINGS = 62
_PENALTY = 3 * _TOP**2
"""Penalty on the squared weights. Inputs are from 0 to `_TOP`; for inputs from 0 to 1, this would
be a penalty of 3."""
STEPS = 4
"""Number of coordinates that are improved after each frame."""
_ROWS = 128
"""Number of rows of `products` that are computed at a time. A copy of all rows would take 0.6
MB."""


class IntegerRidge(LinearPart):
    """A linear score per label, from the first `n_features` values of a vector of bytes.

    After each frame, a few steps bring the weights closer to the solution of `RecursiveRidge`. All
    operations are exact in whole numbers, so all machines agree bit for bit, and errors do not
    accumulate: `residual` always equals `moments - weights @ products`. For inputs z, `products` is
    the sum of z z' (with the penalty on the diagonal), and `moments` the sum of targets times z.

    A frame costs n_features ** 2 additions and multiplications, and each step a few times
    n_features. The pilot's steering angles are not learned here: on a brick, only the learned
    images contribute to the steering.

    Args:
        n_features: Number of values that are used, each from 0 to 255; a constant is added to them.
        steps: Number of coordinates that are improved after each frame.
    """

    fields = (
        Array("products", np.int32, ("size", "size"), high=2 * _FULL),
        Array("linear", np.int64, ("n_labels", "size"), -(2**40), 2**40, "_weights"),
        Array("residual", np.int64, ("n_labels", "size"), -WHOLE, WHOLE),
        Array("halvings", np.int64, (1,), high=_MOST_HALVINGS),
    )

    def __init__(self, n_features: int, *, steps: int = STEPS) -> None:
        if n_features < 1 or steps < 1:
            raise ValueError("n_features and steps must be above 0")
        self.n_features = n_features
        self.steps = steps
        self.size = size = n_features + 1
        self._products = np.diag(np.full(size, _PENALTY, np.int32))
        self._weights = np.zeros((0, size), np.int64)
        self._residual = np.zeros((0, size), np.int64)
        self._halvings = np.zeros(1, np.int64)
        self._work = np.zeros((min(size, _ROWS), size), np.int32)

    def add_label(self) -> None:
        row = np.zeros((1, self.size), np.int64)
        self._weights = np.vstack([self._weights, row])
        self._residual = np.vstack([self._residual, row])

    def scores(self, x: Vector, context: int | None = None) -> Floats:
        scores: Floats = self._weights.dot(self._input(x)) / _ONE
        return scores

    def learn(
        self, x: Vector, targets: Floats, angle: Angle = 0.0, contexts: Collection[int] = EVERY
    ) -> None:
        z = self._input(x)
        errors = (targets * _ONE).astype(np.int64) - self._weights.dot(z)
        self._residual += errors[:, None] * z
        for start in range(0, self.size, _ROWS):
            part = z[start : start + _ROWS, None]
            work = np.multiply(part, z, out=self._work[: len(part)])
            self._products[start : start + _ROWS] += work
        if self._products[-1, -1] >= _FULL:
            self._halve()
        self._improve(self.steps)

    def forget(self, x: Vector, targets: Floats, frames: float, angle: Angle = 0.0) -> None:
        z = self._mean_input(x)
        weight = -frames / 2.0 ** self._halvings[0]
        added = np.rint(weight * np.outer(z, z)).astype(np.int64)
        # rounding may have made a sum of products negative
        np.maximum(added, -self._products, out=added)
        self._products += added.astype(np.int32)
        self._residual += np.rint(weight * _ONE * np.outer(targets, z)).astype(np.int64)
        self._residual -= self._weights.dot(added)
        self._improve(self.steps)

    def retarget(self, x: Vector, change: Floats, angle: Angle = 0.0) -> None:
        added = _ONE / 2.0 ** self._halvings[0] * np.outer(change, self._mean_input(x))
        self._residual += np.rint(added).astype(np.int64)
        self._improve(self.n_features)

    def _improve(self, steps: int) -> None:
        """Reduce the error by changing one weight per step: the weight with the largest
        residual."""
        weights, residual, products = self._weights, self._residual, self._products
        for _ in range(steps):
            label, i = divmod(int(np.abs(residual).argmax()), self.size)
            left, square = int(residual[label, i]), max(int(products[i, i]), 1)
            change = (2 * left + square) // (2 * square)
            if change == 0:
                return
            weights[label, i] += change
            residual[label] -= change * products[i].astype(np.int64)

    def _halve(self) -> None:
        """Halve all sums, so that all frames so far count half as much; the scores do not
        change."""
        moments = self._residual + self._weights.dot(self._products.astype(np.int64))
        self._products >>= 1
        np.fill_diagonal(self._products, self._products.diagonal() + _PENALTY // 2)
        self._residual = (moments >> 1) - self._weights.dot(self._products.astype(np.int64))
        self._halvings += 1

    def _input(self, x: Vector) -> NDArray[np.int32]:
        z = np.empty(self.size, np.int32)
        z[:-1] = x[: self.n_features]
        z >>= _SHIFT
        z[-1] = _TOP
        return z

    def _mean_input(self, x: Vector) -> Floats:
        """Return the inputs for the mean of several frames' vectors. They are not rounded, because
        the mean consists of fractions."""
        return np.append(np.asarray(x[: self.n_features], np.float64) / (1 << _SHIFT), _TOP)

    def faults(self) -> Iterator[str]:
        products = self._products.astype(np.float64)
        squares = products.diagonal()
        if squares.min() < 1 or (products**2 > 1.01 * np.outer(squares, squares) + 1).any():
            yield "the array products does not contain sums of products"
        limits = _ONE * 64.0 * np.sqrt(squares * squares[-1])
        if (np.abs(self._residual) > limits).any():
            yield "the array residual does not match the sums"
