"""A linear part that knows what is under way: one ridge for every view, and one for each context.

A driver begins a turn late and ends it late. Between the two the same view means FORWARD to who
drives straight and LEFT to who turns, and a single linear map takes the mean. So each context has a
ridge of its own. It learns the moves made in it, and the first examples of what followed them.

Each of these learns in blocks: the inverse is large, and a block reads and writes it once; 32
frames together cost less than half of what they cost one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import MOST_VALUES, Array, Arrays, Params, Stateful, first_rows
from robot.learner.ridge import Floats, RecursiveRidge

BLOCK = 32


class BlockRidge(Stateful):
    """Learns as a `RecursiveRidge` does, a block at a time.

    What it knows does not depend on when it was asked.

    Args:
        ridge: What it learns with. Nobody else may use it.
    """

    fields = (
        Array("block_frames", np.float64, (BLOCK, "size"), -MOST_VALUES, MOST_VALUES, "_frames"),
        Array("block_targets", np.float64, (BLOCK, "n_labels"), 0.0, 1.0, "_targets"),
    )

    def __init__(self, ridge: RecursiveRidge) -> None:
        self.size = ridge.size
        self._ridge = ridge
        self._frames = np.zeros((BLOCK, ridge.size))
        self._targets = np.zeros((BLOCK, ridge.n_columns))
        self._n_waiting = 0
        self._weights: Floats | None = None

    def add_label(self) -> None:
        """Add a label, which no frame so far had."""
        self._ridge.add_label()
        self._targets = np.hstack([self._targets, np.zeros((BLOCK, 1))])
        self._weights = None

    def scores(self, x: NDArray[Any]) -> Floats:
        """Return one score a label, as `RecursiveRidge.scores`."""
        if not self._n_waiting:
            return self._ridge.scores(x)
        if self._weights is None:
            self._weights = self._ridge.weights_after(*self._waiting())
        scores: Floats = self._ridge.scaled(x) @ self._weights
        return scores

    def learn_scaled(self, z: Floats, targets: Floats, weight: float = 1.0) -> None:
        """Add a frame that the ridge has scaled `weight` times, with its target scores."""
        root = math.sqrt(weight)
        self._frames[self._n_waiting] = root * z
        self._targets[self._n_waiting] = root * targets
        self._n_waiting += 1
        self._weights = None
        if self._n_waiting == BLOCK:
            self._write()

    def learn(self, x: NDArray[Any], targets: Floats, weight: float = 1.0) -> None:
        """Add a frame `weight` times, or take it back, as `RecursiveRidge.learn`."""
        self._write()
        self._ridge.learn(x, targets, weight)

    def retarget(self, x: NDArray[Any], change: Floats) -> None:
        """Change the targets of frames, as `RecursiveRidge.retarget`."""
        self._write()
        self._ridge.retarget(x, change)

    def _write(self) -> None:
        if self._n_waiting:
            self._ridge.learn_block(*self._waiting())
            self._frames[:], self._targets[:] = 0.0, 0.0
        self._n_waiting, self._weights = 0, None

    def _waiting(self) -> tuple[Floats, Floats]:
        return self._frames[: self._n_waiting], self._targets[: self._n_waiting]

    @property
    def is_indefinite(self) -> bool:
        """True if what was learned before the block is."""
        return self._ridge.is_indefinite

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        return (("", self._ridge),)

    def upgrade(self, params: Params, arrays: Arrays) -> None:
        """Let nothing wait where a `RecursiveRidge` was saved."""
        if not {"block_frames", "block_targets"} & arrays.keys():
            arrays["block_frames"] = np.zeros((BLOCK, self.size))
            arrays["block_targets"] = np.zeros((BLOCK, arrays["linear"].shape[1]))

    def restored(self) -> None:
        self._n_waiting, self._weights = int(self._frames[:, -1].astype(bool).sum()), None

    def faults(self) -> Iterator[str]:
        n = self._n_waiting
        if n == BLOCK or first_rows(self._frames) != n or self._targets[n:].any():
            yield "the array block_frames is over-full, or has gaps"


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

    def begin_angles(self, of_labels: Floats) -> None:
        """Learn an angle, too, as `RecursiveRidge`: one for every view, whatever is under way."""
        self._any.begin_angles(of_labels)

    def angle(self, x: NDArray[Any]) -> float:
        """Return the angle, which is not bounded."""
        return self._any.angle(x)

    def learn_in(
        self, x: NDArray[Any], column: int, contexts: Collection[int], angle: float = 0.0
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
        self, x: NDArray[Any], targets: Floats, weight: float = 1.0, angle: float = 0.0
    ) -> None:
        """Add a frame `weight` times, or take it back; each context gets its share of the label."""
        self._any.learn(x, targets, weight, angle)
        for ridge, shares in zip(self._ridges, self._shares(), strict=False):
            part = float((targets * shares).sum())
            if part > 0.0:
                ridge.learn(x, targets * shares / part, weight * part)

    def retarget(self, x: NDArray[Any], change: Floats, angle: float = 0.0) -> None:
        """Change the targets of frames of mean `x` by `change` in sum; the frames stay."""
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
        self._ridges = [BlockRidge(self._make()) for _ in range(N_CONTEXTS)]
        for ridge in self._ridges:
            self._copy_to(ridge)

    def _copy_to(self, ridge: BlockRidge) -> None:
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

    def restored(self) -> None:
        for ridge in self._ridges:
            for part in (ridge, *(part for _, part in ridge.parts())):
                for field in part.fields:  # else what is out of its bounds would be mended away
                    field.check(part)
            if ridge.is_indefinite:  # frames of the other context were once taken back from it
                self._copy_to(ridge)

    def upgrade(self, params: Params, arrays: Arrays) -> None:
        """Make as many ridges as were saved."""
        n = N_CONTEXTS if "context_counts" in arrays else 0
        self._ridges = [BlockRidge(self._make()) for _ in range(n)]
