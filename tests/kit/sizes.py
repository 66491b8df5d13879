"""Sizes of tests: small in `make test` and in CI, full with `DRIVELESSON_FULL=1`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from itertools import combinations, product
from typing import Any

import pytest

IS_FULL = os.environ.get("DRIVELESSON_FULL") == "1"
"""True if every combination and every size is run."""

only_full = pytest.mark.skipif(not IS_FULL, reason="takes long: needs DRIVELESSON_FULL=1")


def size(name: str, small: int, full: int) -> int:
    """Return the size of a test: `DRIVELESSON_<name>` if it is set, else `small` or `full`.

    Args:
        name: In capitals, as in the environment.
        small: The size in `make test`.
        full: The size with `DRIVELESSON_FULL=1`.
    """
    return int(os.environ.get(f"DRIVELESSON_{name}", full if IS_FULL else small))


def seeds(small: int, full: int) -> range:
    """Return a range of `small` numbers in `make test`, and of `full` at full size."""
    return range(full if IS_FULL else small)


def examples(full: int) -> int:
    """Return the number of hypothesis examples: a fifth of `full`, or `full` at full size."""
    return full if IS_FULL else max(5, full // 5)


def few(values: Iterable[Any], small: int) -> list[Any]:
    """Return all values at full size, and otherwise only `small` values at even distances, the
    first and the last included.

    >>> few(range(10), 3) if not IS_FULL else [0, 4, 9]
    [0, 4, 9]
    """
    every = list(values)
    if IS_FULL or len(every) <= small:
        return every
    return [every[i * (len(every) - 1) // max(small - 1, 1)] for i in range(small)]


def crossed(**axes: Iterable[Any]) -> pytest.MarkDecorator:
    """Parametrize a test with the combinations that `combined` returns."""
    return pytest.mark.parametrize(list(axes), combined(*axes.values()))


def combined(*axes: Iterable[Any]) -> list[tuple[Any, ...]]:
    """Return every combination at full size, and otherwise enough to contain every pair of values.

    With two axes, each value occurs at least once, each time beside another value.
    """
    values = [list(axis) for axis in axes]
    return list(product(*values)) if IS_FULL else covering(values, min(2, len(values) - 1))


def covering(axes: Sequence[Sequence[Any]], strength: int = 2) -> list[tuple[Any, ...]]:
    """Return combinations that contain every `strength` values of different axes.

    The choice is greedy and the same in every run: the next combination is the one that adds most.
    """
    every = list(product(*(range(len(axis)) for axis in axes)))
    groups = list(combinations(range(len(axes)), max(strength, 1)))
    together = {case: {(g, *(case[i] for i in g)) for g in groups} for case in every}
    wanted = set().union(*together.values())
    used = [[0] * len(axis) for axis in axes]
    chosen = []
    while wanted:
        every = [case for case in every if not wanted.isdisjoint(together[case])]
        most = max(len(wanted & together[case]) for case in every)
        best = max(
            (case for case in every if len(wanted & together[case]) == most),
            key=lambda case: (
                -sum(used[i][at] for i, at in enumerate(case)),
                -sum((at - case[0]) % len(axes[i]) for i, at in enumerate(case)),
            ),
        )
        wanted -= together[best]
        for i, at in enumerate(best):
            used[i][at] += 1
        chosen.append(tuple(axes[i][at] for i, at in enumerate(best)))
    return chosen
