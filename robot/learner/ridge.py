"""Online ridge regression from features to labels: exact after every frame, without a matrix solve.

Source: recursive least squares, Haykin, "Adaptive Filter Theory", with a forgetting factor of 1.
After any number of frames the weights equal those of batch ridge regression on all these frames.

The inverse is large, and reading and writing it takes most of the time for a frame. So the ridge
stores the inverse in single precision (`_ROUNDED` bounds the error). The ridge keeps the latest
updates as vectors, and adds several at a time to the inverse. All results include the pending
updates.

A pilot begins a turn late and ends it late. So the same view can mean FORWARD while driving
straight, and LEFT while turning. A single linear map would predict the mean. Therefore each context
also has a ridge (`ContextRidge`), which learns the examples that count in this context.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.learner.linear import EVERY, N_CONTEXTS, Angle, LinearPart
from robot.learner.part import MOST_VALUES, Array, Arrays, Stateful
from robot.learner.votes import Floats

Singles = NDArray[np.float32]
Places = NDArray[np.intp]
_WAITING = 32
"""Number of pending updates of the inverse that are written together. With a larger number, each
evaluation would lose more time than the fewer writes save."""
_ROUNDED = 1e-5
"""Largest rounding error of an eigenvalue of the inverse, as a share of the largest possible
eigenvalue. Each write rounds to single precision, and so adds an error of 6e-8 times the largest
possible eigenvalue."""
_MOST_INVERSE = 1e3
"""Upper bound of an inverse's values, which begin at 1 / penalty and shrink with every frame."""
MIRRORED = 0.3
"""Weight of a frame's mirror image, if left and right are alike. A weight of 1 is not better after
few frames, and is worse after many frames."""


@functools.cache
def _upper(size: int) -> NDArray[np.bool_]:
    """Return the mask of a square matrix's upper triangle."""
    return np.triu(np.ones((size, size), bool))


class RecursiveRidge(LinearPart):
    """A linear score per label, computed from the first `n_features` values of a vector.

    Time and memory are O(n_features ** 2), independent of the number of frames seen.

    Args:
        n_features: Number of values that are used; a constant is added to them.
        penalty: Weight of the squared coefficients.
        scale: The divisor of the values, so that they lie roughly in [0, 1].
        alike: Prior covariance of the weights, shape (n_features, n_features), with diagonal 1; if
            None, the weights are independent. The prior is only the initial value of the inverse,
            so it takes no time per frame.
    """

    fields: Sequence[Array] = (
        Array("triangle", np.float32, ("n_triangle",), -_MOST_INVERSE, _MOST_INVERSE),
        Array("linear", np.float64, ("size", "n_labels"), -1e9, 1e9, attribute="_weights"),
        Array("waiting", np.float32, (_WAITING, "size"), -MOST_VALUES, MOST_VALUES),
        Array("angles", np.float64, ("size", 2), -1e9, 1e9, is_optional=True),
    )

    def __init__(
        self,
        n_features: int,
        *,
        penalty: float = 3.0,
        scale: float = 255.0,
        alike: Floats | None = None,
    ) -> None:
        if n_features < 1 or penalty <= 0.0 or scale <= 0.0:
            raise ValueError("n_features, penalty and scale must be above 0")
        self.n_features, self.penalty, self.scale = n_features, penalty, scale
        self.size = size = n_features + 1
        self.n_triangle = size * (size + 1) // 2
        self._alike = alike
        self._inverse = np.eye(size, dtype=np.float32) / np.float32(penalty)
        self._most = 2.0 / penalty
        if alike is not None:
            self._inverse[:-1, :-1] = alike / penalty
            self._most *= float(np.abs(alike).sum(axis=0).max())  # bounds the eigenvalues
        self._weights = np.zeros((size, 0))
        self._angles: Floats | None = None
        self._work = np.zeros((size, size), np.float32)
        self._waiting = np.zeros((_WAITING, size), np.float32)
        self._n_waiting = 0

    def add_label(self) -> None:
        self._weights = np.hstack([self._weights, np.zeros((len(self._weights), 1))])

    def scores(self, x: Vector, context: int | None = None) -> Floats:
        scores: Floats = self._scaled(x).dot(self._weights)
        return scores

    def begin_like(self, columns: Sequence[int], weights: Floats) -> None:
        """Before the first frame, add `weights` to the prior mean of the weights of `columns`.

        The prior is only as strong as the penalty, so a few frames outweigh it.
        """
        self._weights[:, columns] += weights

    def begin_angles(self, of_labels: Floats) -> None:
        # The weights are a linear function of the targets. So these are the weights that the ridge
        # would have if it had learned the angles from the first frame.
        self._angles = self._weights @ np.stack([of_labels, np.abs(of_labels)], axis=1)

    def angle(self, x: Vector) -> Floats:
        assert self._angles is not None
        both: Floats = self._scaled(x) @ self._angles
        return both

    def learn(
        self, x: Vector, targets: Floats, angle: Angle = 0.0, contexts: Collection[int] = EVERY
    ) -> None:
        self._add(1.0, self._scaled(x), targets, angle)

    def learn_mirrored(
        self, x: Vector, targets: Floats, angle: Angle = 0.0, contexts: Collection[int] = EVERY
    ) -> None:
        """Add the mirror image of a frame. The caller has mirrored all arguments."""
        self._add(MIRRORED, self._scaled(x), targets, angle)

    def reflect(self, places: Places, columns: Sequence[int], on: bool) -> None:
        """Add the mirror images of all frames so far, or remove them again.

        Args:
            places: Index of each feature's mirror image.
            columns: Column of each label's mirrored label.
            on: True to add the mirror images, False to remove them.
        """
        alike = np.eye(self.size)
        if self._alike is not None:
            alike[:-1, :-1] = self._alike
        begun = np.linalg.inv(alike) * self.penalty
        waiting = self._waiting.astype(np.float64)
        seen = np.linalg.inv(self._inverse - waiting.T @ waiting)
        sums = seen @ self._weights
        angles = None if self._angles is None else seen @ self._angles
        # `seen` is a sum over frames, so mirroring the sum mirrors every frame.
        seen, turned = seen - begun, np.append(places, self.size - 1)
        share, rest = (MIRRORED, 1.0) if on else (-MIRRORED, 1.0 - MIRRORED**2)
        seen = (seen + share * seen[np.ix_(turned, turned)]) / rest
        inverse = np.linalg.inv(seen + begun)
        self._weights = inverse @ (sums + share * sums[turned][:, list(columns)]) / rest
        if angles is not None:
            self._angles = inverse @ (angles + share * angles[turned] * [-1.0, 1.0]) / rest
        self._waiting[:], self._n_waiting = 0.0, 0
        self._inverse = (0.5 * (inverse + inverse.T)).astype(np.float32)

    def forget(self, x: Vector, targets: Floats, frames: float, angle: Angle = 0.0) -> None:
        self._add(-frames, self._scaled(x), targets, angle)

    def _add(self, weight: float, z: Floats, targets: Floats, angle: Angle = 0.0) -> None:
        single = z.astype(np.float32)
        direction = self._solve(single)
        rest = 1.0 + weight * float(single @ direction)
        if weight < 0.0 and -weight * float(direction @ direction) > rest * self._most:
            # if a frame that this ridge never learned is removed, the divisor is not positive
            return
        gain = weight / rest
        step = np.multiply(direction, gain, dtype=np.float64)[:, None]
        self._weights += step.dot((targets - z.dot(self._weights))[None])  # faster than np.outer
        if self._angles is not None:
            self._angles += step.dot((angle - z.dot(self._angles))[None])
        if gain < 0.0:  # this happens only when frames are removed, which is rare
            self._write()
            self._inverse -= gain * np.outer(direction, direction)
            return
        self._waiting[self._n_waiting] = math.sqrt(gain) * direction
        self._n_waiting += 1
        if self._n_waiting == _WAITING:
            self._write()

    def _write(self) -> None:
        """Write the pending updates. The inverse stays exactly symmetric, like any product of a
        matrix with its transpose."""
        np.matmul(self._waiting.T, self._waiting, out=self._work)
        self._inverse -= self._work
        self._waiting[:] = 0.0
        self._n_waiting = 0

    def retarget(self, x: Vector, change: Floats, angle: Angle = 0.0) -> None:
        direction = self._solve(self._scaled(x).astype(np.float32))
        self._weights += np.outer(direction, change)
        if self._angles is not None:
            self._angles += np.outer(direction, angle)

    def _solve(self, z: Singles) -> Singles:
        """Return the inverse times `z`, including the pending updates."""
        solution: Singles = self._inverse.dot(z)
        if self._n_waiting:
            waiting = self._waiting[: self._n_waiting]
            solution -= waiting.dot(z).dot(waiting)
        return solution

    def _scaled(self, x: Vector) -> Floats:
        """Return the first `n_features` values, scaled, and a final 1; shape (n_features + 1,)."""
        z = np.ones(self.n_features + 1)
        np.divide(x[: self.n_features], self.scale, out=z[:-1])
        return z

    @property
    def _triangle(self) -> Singles:
        """The upper triangle of the inverse, which is exactly symmetric."""
        return self._inverse[_upper(self.size)]

    @_triangle.setter
    def _triangle(self, triangle: Singles) -> None:
        upper = _upper(self.size)
        self._inverse[upper] = triangle
        self._inverse.T[upper] = triangle

    def restored(self) -> None:
        self._n_waiting = int(self._waiting.any(axis=1).sum())

    @property
    def is_indefinite(self) -> bool:
        """True if the inverse is finite but not positive definite, apart from rounding errors."""
        waiting = self._waiting.astype(np.float64)
        inverse = self._inverse - waiting.T @ waiting
        try:
            np.linalg.cholesky(inverse + _ROUNDED * self._most * np.eye(self.size))
        except np.linalg.LinAlgError:
            return bool(np.isfinite(inverse).all())
        return False

    def faults(self) -> Iterator[str]:
        held = np.asarray(self._waiting.any(axis=1))
        if held[self._n_waiting :].any() or self._n_waiting == _WAITING:
            yield "the array waiting has too many rows, or gaps"
        if self.is_indefinite:
            yield "the array triangle is not the inverse of a learned matrix"


class ContextRidge(RecursiveRidge):
    """One ridge regression for all examples. After the first frame that counts only in some
    contexts, each context also has a ridge. The angle does not depend on the context.
    """

    knows_contexts = True
    fields = (
        *RecursiveRidge.fields,
        Array(
            "context_counts",
            np.int64,
            (1 + N_CONTEXTS, "n_labels"),
            high=1e9,
            attribute="_counts",
        ),
    )

    def __init__(self, n_features: int, **of_each: Any) -> None:
        super().__init__(n_features, **of_each)
        self._ridges: list[RecursiveRidge] = []
        self._counts = np.zeros((1 + N_CONTEXTS, 0), np.int64)

    def add_label(self) -> None:
        super().add_label()
        for ridge in self._ridges:
            ridge.add_label()
        self._counts = np.hstack([self._counts, np.zeros((1 + N_CONTEXTS, 1), np.int64)])

    def scores(self, x: Vector, context: int | None = None) -> Floats:
        if context is None or not self._ridges:
            return super().scores(x)
        return self._ridges[context].scores(x)

    def learn(
        self, x: Vector, targets: Floats, angle: Angle = 0.0, contexts: Collection[int] = EVERY
    ) -> None:
        if len(contexts) < N_CONTEXTS and not self._ridges:
            self._ridges = [self._copy() for _ in EVERY]
        z, column = self._scaled(x), int(targets.argmax())
        self._add(1.0, z, targets, angle)
        self._counts[0, column] += 1
        for context in contexts:
            self._counts[1 + context, column] += 1
            if self._ridges:
                self._ridges[context]._add(1.0, z, targets)

    def learn_mirrored(
        self, x: Vector, targets: Floats, angle: Angle = 0.0, contexts: Collection[int] = EVERY
    ) -> None:
        super().learn_mirrored(x, targets, angle)
        for context in contexts if self._ridges else ():
            self._ridges[context].learn_mirrored(x, targets)

    def reflect(self, places: Places, columns: Sequence[int], on: bool) -> None:
        super().reflect(places, columns, on)
        for ridge in self._ridges:
            ridge.reflect(places, columns, on)

    def forget(self, x: Vector, targets: Floats, frames: float, angle: Angle = 0.0) -> None:
        super().forget(x, targets, frames, angle)
        for ridge, shares in zip(self._ridges, self._shares(), strict=False):
            part = float((targets * shares).sum())
            if part > 0.0:
                ridge.forget(x, targets * shares / part, frames * part)

    def retarget(self, x: Vector, change: Floats, angle: Angle = 0.0) -> None:
        super().retarget(x, change, angle)
        lost = np.minimum(change, 0.0)
        for ridge, shares in zip(self._ridges, self._shares(), strict=False):
            part = float((lost * shares).sum()) / (float(lost.sum()) or 1.0)
            ridge.retarget(x, lost * shares + part * np.maximum(change, 0.0))

    def _shares(self) -> Floats:
        """Return each context's share of each label's frames, shape (N_CONTEXTS, n_labels)."""
        shares: Floats = self._counts[1:] / np.maximum(self._counts[0], 1)
        return shares

    def _copy(self) -> RecursiveRidge:
        """Return a copy of this ridge without angles, from which a context's ridge begins."""
        ridge = RecursiveRidge(
            self.n_features, penalty=self.penalty, scale=self.scale, alike=self._alike
        )
        for name in ("_inverse", "_weights", "_waiting"):
            setattr(ridge, name, getattr(self, name).copy())
        ridge.restored()
        return ridge

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        return [(f"context{context}", ridge) for context, ridge in enumerate(self._ridges)]

    def prepare(self, arrays: Arrays) -> None:
        """Create a ridge for each context that was saved."""
        every = (f"context{context}" for context in range(N_CONTEXTS))
        names = [name for name in every if any(key.startswith(f"{name}_") for key in arrays)]
        self._ridges = [self._copy() for _ in names]

    def restored(self) -> None:
        super().restored()
        for i, ridge in enumerate(self._ridges):
            for field in ridge.fields:  # check before copying: a copy would hide bad values
                field.check(ridge)
            if ridge.is_indefinite:  # more frames were removed than this context had learned
                self._ridges[i] = self._copy()
