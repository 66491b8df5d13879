"""A self-organizing map (Kohonen 1982), from MiniSom; each cell counts the labels it wins."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robot.lab.baselines.wrapped import Baseline, Floats, from_library
from robot.learner.votes import shares

EXPECTED_LESSONS = 700


class SelfOrganizingMap(Baseline):
    """A map of about `number` cells, taught one frame at a time."""

    kind = "som"

    def __init__(self, number: int) -> None:
        self._make = from_library("minisom", "MiniSom", self.kind)
        self._rows = max(1, round(math.sqrt(number)))
        self._columns = max(1, number // self._rows)
        super().__init__(number)

    def _forget(self) -> None:
        self._map: Any = None
        self._votes = np.zeros((self._rows, self._columns, 0))

    def _learn(self, x: Floats, column: int) -> None:
        if self._map is None:
            self._map = self._make(
                self._rows, self._columns, x.size, sigma=1.0, learning_rate=0.5, random_seed=0
            )
        if column == self._votes.shape[2]:
            self._votes = np.concatenate([self._votes, np.zeros((*self._votes.shape[:2], 1))], 2)
        winner = self._map.winner(x)
        self._map.update(x, winner, min(self.n_examples, EXPECTED_LESSONS), EXPECTED_LESSONS)
        self._votes *= 0.999  # a cell moves on, and its old votes with it
        self._votes[(*winner, column)] += 1.0

    def _shares(self, x: Floats) -> Floats:
        votes: Floats = self._votes[self._map.winner(x)]
        return shares(votes if votes.any() else self._votes.sum(axis=(0, 1)))
