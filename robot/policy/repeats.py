"""Recognises repeated views: the same lap taught sixteen times does not count as sixteen laps.

If a linear part learned every lap in full, its penalty would lose its effect and it would learn the
noise of one lap by heart. Images averaged over sixteen times as many frames would adapt too slowly
to new views. So a view that comes again with its last label is counted, but not learned again. A
new view is learned in full, and so is a view with another label than the last time.

A view is recognised by a sketch: 128 comparisons between fixed pairs of feature values (binary
features, as in BRIEF; Calonder et al. 2010), hashed to 64 bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b

import numpy as np

from robot.learner.base import Vector
from robot.learner.part import Array
from robot.policy.part import PolicyPart, TaughtExample
from robot.types import Action

_BITS, _SETS, _WAYS = 128, 4096, 4
"""Number of pairs of a sketch; number and size of the sets in which sketches are stored. 16,384
sketches are enough for a lap of 27 minutes at ten examples a second."""


class Repeats(PolicyPart):
    """Stores the latest views, each with its label, in constant time and memory.

    Args:
        moves: The labels.
    """

    fields = (
        Array("repeats", np.uint64, (_SETS, _WAYS), high=2.0**64, attribute="_sketches", older=0),
        Array("repeats_labels", np.int16, (_SETS, _WAYS), attribute="_labels", older=0),
    )

    def __init__(self, moves: Sequence[Action]) -> None:
        self._moves = moves
        self._pairs = np.zeros((2, 0), np.intp)
        self._sketches = np.zeros((_SETS, _WAYS), np.uint64)
        self._labels = np.zeros((_SETS, _WAYS), np.int16)  # 0: empty slot

    def on_example(self, lesson: TaughtExample) -> None:
        if not lesson.is_learned:
            return
        label = 1 + self._moves.index(lesson.label)
        sketch = self._sketch(lesson.x)
        row = sketch % _SETS
        sketches, labels = self._sketches[row].tolist(), self._labels[row].tolist()
        ways = [way for way in range(_WAYS) if labels[way] and sketches[way] == sketch]
        lesson.is_learned = not ways or labels[ways[0]] != label
        empty = [way for way in range(_WAYS) if not labels[way]]
        way = (ways or empty or [lesson.number % _WAYS])[0]
        self._sketches[row, way], self._labels[row, way] = sketch, label

    def _sketch(self, x: Vector) -> int:
        if not self._pairs.size or self._pairs.max() >= len(x):
            self._pairs = np.random.default_rng(0).integers(0, len(x), (2, _BITS))
        bits = x[self._pairs[0]] > x[self._pairs[1]]
        return int.from_bytes(blake2b(np.packbits(bits).tobytes(), digest_size=8).digest(), "big")
