"""Statistics of a dataset in LeRobot's form: of pictures by colour, and of columns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.policy.image import Pixels

Columns = dict[str, NDArray[Any]]
"""Values of a frame each, by feature."""
Stats = dict[str, dict[str, list[Any]]]
"""Least, most, mean, deviation, quantiles and count, by feature."""
_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}


class Brightness:
    """How often each brightness occurs in pictures, by colour: all statistics follow from it."""

    def __init__(self) -> None:
        self._pictures = 0
        self._counts = np.zeros((3, 256), np.int64)

    def add(self, picture: Pixels) -> Pixels:
        """Add one picture, shape (height, width, 3), and return it unchanged."""
        self._pictures += 1
        self._counts += [np.bincount(colour, minlength=256) for colour in picture.reshape(-1, 3).T]
        return picture

    def join(self, other: Brightness) -> None:
        """Add the pictures of another one."""
        self._pictures += other._pictures
        self._counts += other._counts

    def stats(self) -> dict[str, list[Any]]:
        """Return the statistics as shares of full brightness, shape (3, 1, 1), and the count."""
        shares, below = np.arange(256) / 255.0, self._counts.cumsum(axis=1)
        total = below[:, -1:]
        mean = (self._counts * shares).sum(axis=1, keepdims=True) / total
        deviations = self._counts * (shares - mean) ** 2
        found = {
            "min": [shares[counts.nonzero()[0][0]] for counts in self._counts],
            "max": [shares[counts.nonzero()[0][-1]] for counts in self._counts],
            "mean": mean,
            "std": np.sqrt(deviations.sum(axis=1, keepdims=True) / total),
        }
        for name, share in _QUANTILES.items():
            found[name] = shares[(below < share * total).sum(axis=1)]
        plain = {name: np.reshape(of, (3, 1, 1)).tolist() for name, of in found.items()}
        return {**plain, "count": [self._pictures]}


def column_stats(values: NDArray[Any]) -> dict[str, list[Any]]:
    """Return the statistics of a feature, shape (frames,) or (frames, n)."""
    table = values.reshape(len(values), -1).astype(np.float64)
    return {
        "min": table.min(axis=0).tolist(),
        "max": table.max(axis=0).tolist(),
        "mean": table.mean(axis=0).tolist(),
        "std": table.std(axis=0).tolist(),
        **{name: np.quantile(table, q, axis=0).tolist() for name, q in _QUANTILES.items()},
        "count": [len(table)],
    }
