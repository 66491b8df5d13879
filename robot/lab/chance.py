"""Measures the effect of chance on a result: standard deviations and bootstrap intervals."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import numpy as np

_DRAWS = 2000
"""Number of bootstrap samples for an interval."""


def deviation(values: Sequence[float]) -> float:
    """Return the standard deviation of a sample; 0 for a single value."""
    return statistics.stdev(values) if len(values) > 1 else 0.0


def mean_of_known(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of the mean of some runs; reproducible."""
    draws = np.random.default_rng(0).choice(values, (_DRAWS, len(values)))
    low, high = np.quantile(draws.mean(axis=1), (0.025, 0.975))
    return float(low), float(high)


def difference_by_chance(values: Sequence[float], others: Sequence[float]) -> tuple[float, float]:
    """Return the 90 % bootstrap interval of the difference between two medians.

    Half of the sum of squared differences (SSD) of one minute of driving is due to chance. Even the
    medians of two groups of sixty robots may differ by a fifth because of chance.
    """
    rng = np.random.default_rng(0)
    ours, theirs = (
        np.median(rng.choice(sample, (_DRAWS, len(sample))), axis=1) for sample in (values, others)
    )
    least, most = np.quantile(ours - theirs, (0.05, 0.95))
    return float(least), float(most)


def mean_in_interval(values: Sequence[float], digits: int = 2) -> str:
    """Return the mean of some runs as text, with its interval in brackets."""
    low, high = (f"{end:.{digits}f}" for end in interval(values))
    return f"{statistics.fmean(values):.{digits}f} [{low}, {high}]"
