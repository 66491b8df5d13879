"""The weights between all pairs of nodes, and the pair with the smallest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

CACHED_FROM = 200
"""Nodes from which on each row's least is kept. Below, one argmin over all weights is faster:
2 us against 9 at 128 nodes, 340 us against 25 at 1024."""


class Edges:
    """A symmetric matrix of weights; infinite where there is no edge."""

    def __init__(self, max_nodes: int) -> None:
        self.weights = np.full((max_nodes, max_nodes), np.inf, np.float32)
        self._n = max_nodes
        self._is_cached = max_nodes >= CACHED_FROM
        self._least = np.full(max_nodes, np.inf, np.float32)
        self._partner = np.zeros(max_nodes, np.int64)

    def smallest(self) -> tuple[float, int, int]:
        """Return weight and ends of the smallest edge; the lowest indices on a tie."""
        if self._is_cached:
            one = int(self._least.argmin())
            return float(self._least[one]), one, int(self._partner[one])
        one, two = divmod(int(self.weights.argmin()), self._n)
        return float(self.weights[one, two]), one, two

    def set_row(self, node: int, weights: Floats) -> None:
        """Write one node's weights to the first `len(weights)` nodes."""
        weights[node] = np.inf
        size = weights.size
        self.weights[node, :size] = weights
        self.weights[:size, node] = weights
        if self._is_cached:
            self._update(node, weights)

    def remove(self, node: int, last: int) -> None:
        """Let the last node take the place of `node`."""
        row = self.weights[last, : last + 1].copy()
        row[last] = np.inf
        self.weights[last, :] = np.inf
        self.weights[:, last] = np.inf
        row = row[:last]
        if node != last:
            self.weights[node, :last] = row
            self.weights[:last, node] = row
            self.weights[node, node] = np.inf
        self.rebuild()

    def rebuild(self) -> None:
        """Find each row's smallest weight again, after the weights were replaced."""
        self._partner = self.weights.argmin(axis=1)
        self._least = self.weights[np.arange(self._n), self._partner]

    def _update(self, node: int, weights: Floats) -> None:
        """Update each row's smallest weight after one node's weights changed."""
        size = weights.size
        least, partner = self._least[:size], self._partner[:size]
        lost = np.flatnonzero(partner == node)
        better = (weights < least) | ((weights == least) & (node < partner))
        least[better] = weights[better]
        partner[better] = node
        for row in lost.tolist():
            self._rescan(row)
        self._rescan(node)

    def _rescan(self, row: int) -> None:
        best = int(self.weights[row].argmin())
        self._partner[row] = best
        self._least[row] = self.weights[row, best]
