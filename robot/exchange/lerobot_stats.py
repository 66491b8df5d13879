"""Statistics of a dataset in LeRobot's form: of pictures by colour, and of columns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.policy.image import Pixels

Columns = dict[str, NDArray[Any]]
"""Values of a frame each, by feature."""
Stats = dict[str, dict[str, list[Any]]]
"""Least, most, mean, deviation and count, by feature."""


class PictureSums:
    """Statistics of pictures by colour, as shares of full brightness, shape (3, 1, 1)."""

    def __init__(self) -> None:
        self._count = self._pixels = 0
        self._sum, self._squares = np.zeros(3), np.zeros(3)
        self._least, self._most = np.ones(3), np.zeros(3)

    def add(self, picture: Pixels) -> Pixels:
        """Add one picture, shape (height, width, 3), and return it unchanged."""
        shares = picture.reshape(-1, 3) / 255.0
        self._count += 1
        self._pixels += len(shares)
        self._sum += shares.sum(axis=0)
        self._squares += (shares**2).sum(axis=0)
        self._least = np.minimum(self._least, shares.min(axis=0))
        self._most = np.maximum(self._most, shares.max(axis=0))
        return picture

    def stats(self) -> dict[str, list[Any]]:
        """Return minimum, maximum, mean and deviation of each colour, and the count of pictures."""
        mean = self._sum / self._pixels
        variance = np.clip(self._squares / self._pixels - mean**2, 0, None)
        values = {"min": self._least, "max": self._most, "mean": mean, "std": np.sqrt(variance)}
        plain: dict[str, list[Any]] = {k: v.reshape(3, 1, 1).tolist() for k, v in values.items()}
        return {**plain, "count": [self._count]}


def column_stats(values: NDArray[Any]) -> dict[str, list[Any]]:
    """Return the statistics of a feature, shape (frames,) or (frames, n)."""
    table = values.reshape(len(values), -1).astype(np.float64)
    return {
        "min": table.min(axis=0).tolist(),
        "max": table.max(axis=0).tolist(),
        "mean": table.mean(axis=0).tolist(),
        "std": table.std(axis=0).tolist(),
        "count": [len(table)],
    }


def joined_stats(parts: list[Stats]) -> Stats:
    """Join the statistics of episodes, each weighted by its frames."""
    joined: Stats = {}
    for name in parts[0]:
        counts = np.array([part[name]["count"][0] for part in parts], np.float64)
        means = np.array([part[name]["mean"] for part in parts])
        stds = np.array([part[name]["std"] for part in parts])
        weights = (counts / counts.sum()).reshape(-1, *([1] * (means.ndim - 1)))
        mean = (weights * means).sum(axis=0)
        variance = (weights * (stds**2 + (means - mean) ** 2)).sum(axis=0)
        joined[name] = {
            "min": np.min([part[name]["min"] for part in parts], axis=0).tolist(),
            "max": np.max([part[name]["max"] for part in parts], axis=0).tolist(),
            "mean": mean.tolist(),
            "std": np.sqrt(variance).tolist(),
            "count": [int(counts.sum())],
        }
    return joined
