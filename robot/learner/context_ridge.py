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

from robot.learner.block_ridge import BlockRidge
from robot.learner.part import Array, Arrays, Params, Stateful
from robot.learner.ridge import Floats, RecursiveRidge

N_CONTEXTS = 2


class ContextRidge(Stateful):
    """A `LinearPart` with a second opinion for each context.

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
        self._ridges: list[BlockRidge] = []
        self._counts = np.zeros((1 + N_CONTEXTS, 0), np.int64)

    def add_label(self) -> None:
        """Add a label, which no frame so far had."""
        self._any.add_label()
        for ridge in self._ridges:
            ridge.add_label()
        self._counts = np.hstack([self._counts, np.zeros((1 + N_CONTEXTS, 1), np.int64)])

    def scores(self, x: NDArray[Any]) -> Floats:
        """Return one score a label in any context, shape (n_labels,)."""
        return self._any.scores(x)

    def scores_in(self, x: NDArray[Any], context: int) -> Floats:
        """Return one score a label in one context, shape (n_labels,)."""
        return (self._ridges[context] if self._ridges else self._any).scores(x)

    def learn_in(self, x: NDArray[Any], column: int, contexts: Collection[int]) -> None:
        """Add a frame of one label to the ridge for every view, and to those of `contexts`."""
        if not self._ridges and len(contexts) < N_CONTEXTS:
            self._part()
        targets = np.eye(self._counts.shape[1])[column]
        z = self._any.scaled(x)
        self._any.learn_scaled(z, targets)
        self._counts[0, column] += 1
        for context in contexts:
            self._counts[1 + context, column] += 1
            if self._ridges:
                self._ridges[context].learn_scaled(z, targets)

    def learn(self, x: NDArray[Any], targets: Floats, weight: float = 1.0) -> None:
        """Add a frame `weight` times, or take it back; each context gets its share of the label."""
        self._any.learn(x, targets, weight)
        for ridge, shares in zip(self._ridges, self._shares(), strict=False):
            part = float((targets * shares).sum())
            if part > 0.0:
                ridge.learn(x, targets * shares / part, weight * part)

    def retarget(self, x: NDArray[Any], change: Floats) -> None:
        """Change the targets of frames of mean `x` by `change` in sum; the frames stay."""
        self._any.retarget(x, change)
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
        self._ridges = [BlockRidge(self._make()) for _ in range(N_CONTEXTS)]
        for ridge in self._ridges:
            ridge.load(*self._any.save())

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

    def restored(self) -> None:
        for ridge in self._ridges:
            if ridge.is_indefinite:  # frames of the other context were once taken back from it
                ridge.load(*self._any.save())

    def upgrade(self, params: Params, arrays: Arrays) -> None:
        """Make as many ridges as were saved."""
        n = N_CONTEXTS if "context_counts" in arrays else 0
        self._ridges = [BlockRidge(self._make()) for _ in range(n)]
