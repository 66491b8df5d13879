"""Statistics of a dataset in LeRobot's form: of pictures by colour, and of columns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Columns = dict[str, NDArray[Any]]
"""Values of a frame each, by feature."""
Stats = dict[str, dict[str, list[Any]]]
"""Least, most, mean, deviation, quantiles and count, by feature."""
_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}


def brightness_stats(counts: NDArray[np.int64], n_pictures: int) -> dict[str, list[Any]]:
    """Return the statistics as shares of full brightness, shape (3, 1, 1), and the count."""
    shares, below = np.arange(256) / 255.0, counts.cumsum(axis=1)
    total = below[:, -1:]
    mean = (counts * shares).sum(axis=1, keepdims=True) / total
    deviations = counts * (shares - mean) ** 2
    ranks = {"min": 1, "max": total, **{name: q * total for name, q in _QUANTILES.items()}}
    found = {name: shares[(below < rank).sum(axis=1)] for name, rank in ranks.items()}
    found |= {"mean": mean, "std": np.sqrt(deviations.sum(axis=1, keepdims=True) / total)}
    plain = {name: np.reshape(of, (3, 1, 1)).tolist() for name, of in found.items()}
    return {**plain, "count": [n_pictures]}


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
