"""A linear part that knows what is under way: one ridge for every view, and one for each context.

A driver begins a turn late and ends it late. Between the two the same view means FORWARD to who
drives straight and LEFT to who turns, and a single linear map takes the mean. So each context has a
ridge of its own. It learns the moves made in it, and the first examples of what followed them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import MOST_VALUES, Array, Arrays, Params, Stateful
from robot.learner.ridge import Floats, LinearPart, RecursiveRidge
from robot.learner.values import demand

N_CONTEXTS = 2


class ContextRidge(LinearPart):
    """A second opinion for each context; the angle is learned whatever is under way.

    As long as every frame counted in all contexts there is one ridge for all of them.

    Args:
        make: Makes a ridge; all are of one kind.
    """

    fields = (
        Array("context_counts", np.int64, (1 + N_CONTEXTS, "n_labels"), high=1e9, may_miss=True),
    )

    def __init__(self, make: Callable[[], RecursiveRidge]) -> None:
        self._make = make
        self._any = make()
        self._ridges: list[RecursiveRidge] = []
        self._counts = np.zeros((1 + N_CONTEXTS, 0), np.int64)
        self._held_back: list[list[Floats]] = []

    def add_label(self) -> None:
        self._any.add_label()
        for ridge in self._ridges:
            ridge.add_label()
        self._counts = np.hstack([self._counts, np.zeros((1 + N_CONTEXTS, 1), np.int64)])

    def scores(self, x: NDArray[Any]) -> Floats:
        return self._any.scores(x)

    def scores_in(self, x: NDArray[Any], context: int) -> Floats:
        """Return one score a label in one context, shape (n_labels,)."""
        return (self._ridges[context] if self._ridges else self._any).scores(x)

    def begin_angles(self, of_labels: Floats) -> None:
        self._any.begin_angles(of_labels)

    def angle(self, x: NDArray[Any]) -> Floats:
        return self._any.angle(x)

    def learn_in(
        self, x: NDArray[Any], column: int, contexts: Collection[int], angle: Floats | float = 0.0
    ) -> None:
        """Add a frame of one label to the ridge for every view, and to those of `contexts`."""
        if not self._ridges and len(contexts) < N_CONTEXTS:
            self._part()
        targets = np.eye(self._counts.shape[1])[column]
        z = self._any.scaled(x)
        self._any.learn_scaled(z, targets, angle=angle)
        self._counts[0, column] += 1
        for context in contexts:
            self._counts[1 + context, column] += 1
            if self._ridges:
                self._ridges[context].learn_scaled(z, targets)

    def learn(
        self, x: NDArray[Any], targets: Floats, weight: float = 1.0, angle: Floats | float = 0.0
    ) -> None:
        """Add a frame `weight` times, or take it back; each context gets its share of the label."""
        self._any.learn(x, targets, weight, angle)
        for ridge, shares in zip(self._ridges, self._shares(), strict=False):
            part = float((targets * shares).sum())
            if part > 0.0:
                ridge.learn(x, targets * shares / part, weight * part)

    def retarget(self, x: NDArray[Any], change: Floats, angle: Floats | float = 0.0) -> None:
        self._any.retarget(x, change, angle)
        lost = np.minimum(change, 0.0)
        for ridge, shares in zip(self._ridges, self._shares(), strict=False):
            part = float((lost * shares).sum()) / (float(lost.sum()) or 1.0)
            ridge.retarget(x, lost * shares + part * np.maximum(change, 0.0))

    def _shares(self) -> Floats:
        """Return how many of each label's frames each context has, shape (N_CONTEXTS, n_labels)."""
        shares: Floats = self._counts[1:] / np.maximum(self._counts[0], 1)
        return shares

    def _part(self) -> None:
        """Give each context a copy of what all have in common so far."""
        self._ridges = [self._make() for _ in range(N_CONTEXTS)]
        for ridge in self._ridges:
            self._copy_to(ridge)

    def _copy_to(self, ridge: RecursiveRidge) -> None:
        params, arrays = self._any.save()
        arrays.pop("angles", None)
        ridge.load(params, arrays)

    @property
    def _context_counts(self) -> NDArray[np.int64] | None:
        """The counts, as soon as they tell contexts apart."""
        return self._counts if self._ridges else None

    @_context_counts.setter
    def _context_counts(self, counts: NDArray[np.int64] | None) -> None:
        together = np.ones((1 + N_CONTEXTS, self._any.n_columns), np.int64)
        self._counts = together if counts is None else counts

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        own = [(f"context{context}", ridge) for context, ridge in enumerate(self._ridges)]
        return [("", self._any), *own]

    def upgrade(self, params: Params, arrays: Arrays) -> None:
        """Make as many ridges as were saved; those of version 0.2 held some frames back."""
        names = [f"context{context}" for context in range(N_CONTEXTS) if "context_counts" in arrays]
        self._ridges = [self._make() for _ in names]
        self._held_back = [
            [arrays.pop(f"{name}_block_{what}", np.zeros((0, 0))) for what in ("frames", "targets")]
            for name in names
        ]

    def restored(self) -> None:
        for ridge, (frames, targets) in zip(self._ridges, self._held_back, strict=True):
            for field in ridge.fields:  # else what is out of its bounds would be mended away
                field.check(ridge)
            if ridge.is_indefinite:  # frames of the other context were once taken back from it
                self._copy_to(ridge)
            if len(frames):
                sides = ((len(frames), ridge.size), (len(frames), ridge.n_columns))
                is_like_it = frames.dtype == targets.dtype == np.float64
                demand(is_like_it and (frames.shape, targets.shape) == sides, "frames do not fit")
                demand(bool(np.abs(frames).max() <= MOST_VALUES), "frames are out of bounds")
                for z, target in zip(frames[frames[:, -1] != 0.0], targets, strict=False):
                    ridge.learn_scaled(z, target)
        self._held_back = []
