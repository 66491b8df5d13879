"""Notices that the pilot has changed his mind: a label that is no longer used where it was taught.

Recorded labels disagree with confident nodes all the time: between a turn and driving on, the same
view means both. So one contradiction says nothing. A label counts as given up when

1. views that an older image remembers as this label now get another one, for a second in sum;
2. it was left out for longer than ever before: two more runs of the other labels than its longest
   absence so far. A pilot who turns left or right as it comes leaves both out for a while;
3. neither of the two labels is the one that is always taken up in between, such as FORWARD.
"""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
from numpy.typing import NDArray

CONTRADICTIONS = 10
"""So many examples, a second of teaching, have to contradict what was remembered,"""
LONGER_RUNS = 2
"""and the label has to be absent for so many runs of other labels more than ever before."""
_FEWEST_RUNS = 3
_SHORTEST_RUN = 3
"""A shorter run of a label is a slip of the finger."""
_REMEMBERED_RUNS = 64


class ChangeOfMind:
    """Follows the labels of the examples; labels are columns 0, 1, ... in the order of learning."""

    def __init__(self) -> None:
        self._runs: list[int] = []
        self._label = -1
        self._length = 0
        self._contrary = np.zeros((0, 0), np.int64)

    def add_label(self) -> None:
        """Make room for one more label."""
        self._contrary = np.pad(self._contrary, (0, 1))

    def note(self, label: int, remembered: int | None) -> int | None:
        """Process one example; return the label that was given up for this one, if one was.

        Args:
            label: The example's label.
            remembered: What the nearest image without recent examples says; None: there is none.
        """
        if label != self._label:
            self._label, self._length = label, 0
        self._length += 1
        if self._length == _SHORTEST_RUN:
            self._runs = [*self._runs[1 - _REMEMBERED_RUNS :], label]
            self._contrary[label] = 0  # it is in use
        if remembered is None or remembered == label or self._length < _SHORTEST_RUN:
            return None
        self._contrary[remembered, label] += 1
        if self._contrary[remembered, label] < CONTRADICTIONS:
            return None
        if not self._is_given_up(remembered, label):
            return None
        self._contrary[remembered, label] = 0
        return remembered

    def _is_given_up(self, old: int, new: int) -> bool:
        counts = Counter(self._runs)
        usual = counts.most_common(1)[0][0]
        if usual in (old, new) or counts[old] < _FEWEST_RUNS:
            return False
        others = [label for label in self._runs if label != usual]
        at = [i for i, label in enumerate(others) if label == old]
        longest = max(b - a - 1 for a, b in itertools.pairwise(at))
        return len(others) - 1 - at[-1] >= longest + LONGER_RUNS

    def get_arrays(self) -> dict[str, NDArray[np.int64]]:
        """Return the runs and counts as arrays of a fixed shape."""
        runs = np.zeros(_REMEMBERED_RUNS + 2, np.int64)  # 0: none, else the column and 1
        runs[:2] = self._length, self._label + 1
        runs[2 : 2 + len(self._runs)] = [label + 1 for label in self._runs]
        return {"runs": runs, "contrary": self._contrary.copy()}

    def set_arrays(self, arrays: dict[str, NDArray[np.int64]], n_labels: int) -> None:
        """Restore what `get_arrays` returned; models of version 0.1 have none of it."""
        runs = arrays.get("runs", np.zeros(2, np.int64)).tolist()
        self._length, self._label = runs[0], runs[1] - 1
        self._runs = [label - 1 for label in runs[2:] if label > 0]
        empty = np.zeros((n_labels, n_labels), np.int64)
        self._contrary = arrays.get("contrary", empty).copy()
