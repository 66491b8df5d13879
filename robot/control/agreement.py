"""How often the robot would have done what the pilot did, over the last seconds of teaching."""

from __future__ import annotations

from collections import deque

WINDOW_S = 10.0
"""A time, not a number of examples: at thirty a second a hundred are one way straight ahead."""


class Agreement:
    """Compares predictions with the labels that came after them. Constant time an example."""

    def __init__(self) -> None:
        self._examples: deque[tuple[float, bool]] = deque()
        self._n_right = 0

    @property
    def n_examples(self) -> int:
        """Over how many examples it is measured."""
        return len(self._examples)

    @property
    def share(self) -> float | None:
        """Share of the examples that were predicted correctly; None before the first."""
        return self._n_right / len(self._examples) if self._examples else None

    def add(self, at_s: float, *, is_right: bool) -> None:
        """Add an example, predicted before it was learned; its teaching time never goes back."""
        self._examples.append((at_s, is_right))
        self._n_right += is_right
        while self._examples[0][0] <= at_s - WINDOW_S:
            self._n_right -= self._examples.popleft()[1]

    def drop_after(self, at_s: float) -> None:
        """Drop what is later than this teaching time: it was undone."""
        while self._examples and self._examples[-1][0] > at_s:
            self._n_right -= self._examples.pop()[1]

    def clear(self) -> None:
        """Drop everything: another policy learns."""
        self._examples.clear()
        self._n_right = 0
