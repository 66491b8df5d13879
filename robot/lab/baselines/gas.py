"""Growing neural gas (Fritzke 1995), the paper's nearest relative; no common library has it."""

from __future__ import annotations

import numpy as np

from robot.lab.baselines.wrapped import Baseline, Floats
from robot.learner.votes import shares

STEP_WINNER, STEP_NEIGHBOUR = 0.1, 0.006
MAX_AGE, GROW_EVERY, SPLIT, FADE = 50, 20, 0.5, 0.995


class GrowingNeuralGas(Baseline):
    """Nodes that follow the frames, joined by edges that age; one more node every 20 frames.

    The number is of nodes at most.
    """

    kind = "gas"

    def _forget(self) -> None:
        self._nodes = np.zeros((0, 0))
        self._errors = np.zeros(0)
        self._votes = np.zeros((0, 16))
        self._ages = np.zeros((0, 0))  # nan: no edge
        self._n_learned = 0

    def _learn(self, x: Floats, column: int) -> None:
        self._n_learned += 1
        if len(self._nodes) < 2:
            self._append(x.copy(), 0.0)
            self._votes[-1, column] += 1.0
            return
        distances = ((self._nodes - x) ** 2).sum(axis=1)
        first, second = np.argsort(distances)[:2].tolist()
        self._errors[first] += distances[first]
        self._ages[first] += 1.0
        self._ages[:, first] = self._ages[first]
        near = np.flatnonzero(~np.isnan(self._ages[first]))
        self._nodes[first] += STEP_WINNER * (x - self._nodes[first])
        self._nodes[near] += STEP_NEIGHBOUR * (x - self._nodes[near])
        self._ages[first, second] = self._ages[second, first] = 0.0
        self._votes[first, column] += 1.0
        self._prune()
        if self._n_learned % GROW_EVERY == 0 and len(self._nodes) < max(2, self.number):
            self._grow()
        self._errors *= FADE

    def _prune(self) -> None:
        """Cut edges that are too old, then nodes that have none left."""
        self._ages[self._ages > MAX_AGE] = np.nan
        joined = ~np.isnan(self._ages).all(axis=1)
        if joined.sum() >= 2 and not joined.all():
            self._nodes, self._errors = self._nodes[joined], self._errors[joined]
            self._votes, self._ages = self._votes[joined], self._ages[joined][:, joined]

    def _grow(self) -> None:
        """Put a node between the one of most error and its neighbour of most error."""
        worst = int(self._errors.argmax())
        near = np.flatnonzero(~np.isnan(self._ages[worst]))
        if near.size == 0:
            return
        other = int(near[self._errors[near].argmax()])
        self._errors[[worst, other]] *= SPLIT
        self._append((self._nodes[worst] + self._nodes[other]) / 2, float(self._errors[worst]))
        self._ages[worst, other] = self._ages[other, worst] = np.nan
        for end in (worst, other):
            self._ages[-1, end] = self._ages[end, -1] = 0.0

    def _append(self, image: Floats, error: float) -> None:
        n = len(self._nodes)
        self._nodes = np.vstack([self._nodes, image]) if n else image[None, :]
        self._errors = np.append(self._errors, error)
        self._votes = np.vstack([self._votes, np.zeros((1, 16))])
        self._ages = np.pad(self._ages, ((0, 1), (0, 1)), constant_values=np.nan)

    def _shares(self, x: Floats) -> Floats:
        order = np.argsort(((self._nodes - x) ** 2).sum(axis=1))
        for node in order.tolist():
            if self._votes[node].any():
                return shares(self._votes[node, : len(self.labels_)])
        return shares(np.zeros(len(self.labels_)))
