"""Decides which examples are learned, and in which contexts: driving straight, or turning.

Frames less than a tenth of a second apart show almost the same picture. So the policy learns only
one example per tenth of a second (`ExampleRate`).

An example counts in the context of its own move. The first half second of a move also counts in the
context of the previous move, so that the robot learns when to end that move. After a pause the
previous move is unknown, so the first examples count in both contexts. The contexts depend only on
the labels and their teaching times, so they are the same after an undo.

If a view comes again with the label that it had last time, the policy counts the example, but does
not learn it again (`Repeats`). Otherwise, after sixteen equal laps, the linear part would have
memorised the noise of the lap, and the images would adapt too slowly to new views.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from hashlib import blake2b

import numpy as np

from robot.learner.base import Vector
from robot.learner.part import Array, Value
from robot.learner.values import name, number, optional, row
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import PolicyPart, Seen, TaughtExample
from robot.policy.pilot_pace import PAUSE_S
from robot.types import Action

ROOM_S = 0.1
"""Minimum time between two learned examples of one label, in seconds; examples that come sooner are
only counted."""
EARLY_S = 0.03
"""Tolerance of `ROOM_S`, in seconds. At thirty frames a second it lets the policy learn every third
frame, although three frames may take a little less time than `ROOM_S`."""


class ExampleRate(PolicyPart):
    """Limits the rate of learned examples with the same label. The first example after a change of
    label is always learned, and so is each example without a time."""

    fields = (Value("last_learned", optional(row(number(), name))),)

    def __init__(self) -> None:
        self._last_learned: tuple[float, str] | None = None  # (scheduled time, label)

    def on_example(self, lesson: TaughtExample) -> None:
        at_s, label = lesson.at_s, str(lesson.label)
        if at_s is None:
            self._last_learned = None
            return
        room_from_s, last_label = self._last_learned or (-math.inf, "")
        since_s = at_s - room_from_s if label == last_label else math.inf
        lesson.is_learned = not -ROOM_S < since_s < ROOM_S - EARLY_S
        if lesson.is_learned:
            is_in_time = 0.0 < since_s < 2.0 * ROOM_S
            self._last_learned = (room_from_s + ROOM_S if is_in_time else at_s), label


STRAIGHT, TURNING = 0, 1
BOTH = (STRAIGHT, TURNING)
ONSET_S = 0.5
"""Time after a change of move during which an example also counts in the previous move's context,
in seconds."""


class MoveContext(PolicyPart):
    """Determines the contexts of examples. If no move is known to turn, both contexts count."""

    fields = (
        Value("move", optional(name)),
        Value("before", optional(name)),
        Value("since_s", number(0.0)),
        Value("last_s", number(0.0)),
    )

    def __init__(self, kinds: MoveKinds) -> None:
        self._kinds = kinds
        self._move: Action | None = None
        self._before: Action | None = None
        self._since_s = 0.0
        self._last_s = 0.0

    def on_frame(self, seen: Seen) -> None:
        seen.in_context = True
        if seen.under_way is not None:
            seen.context = self._of(seen.under_way)

    def on_example(self, lesson: TaughtExample) -> None:
        label, at_s = lesson.label, lesson.at_s
        lesson.contexts = BOTH
        if at_s is None or not self._kinds.turns:
            self._move = None
            return
        before = self._move if 0.0 <= at_s - self._last_s <= PAUSE_S else None
        if before is not label:
            self._before, self._move, self._since_s = before, label, at_s
        self._last_s = at_s
        own = self._of(label)
        is_alike = self._before is not None and self._of(self._before) == own
        if is_alike or at_s - self._since_s > ONSET_S:
            lesson.contexts = (own,)

    def _of(self, move: Action) -> int:
        return TURNING if move in self._kinds.turns else STRAIGHT

    def restored(self) -> None:
        if self._since_s > self._last_s:
            raise ValueError(f"a move cannot last from {self._since_s} to {self._last_s} s")


_BITS, _SETS, _WAYS = 128, 4096, 4
"""A sketch is a hash of `_BITS` comparisons of feature values. There are `_SETS` sets of `_WAYS`
sketches. These 16,384 sketches suffice for a lap of 27 minutes at ten examples a second."""


class Repeats(PolicyPart):
    """Remembers the latest views and their labels, in constant time and memory.

    A view is recognised by a 64-bit hash of a binary descriptor: 128 comparisons of fixed pairs of
    feature values (as in BRIEF, Calonder et al. 2010).
    """

    fields = (
        Array("repeats", np.uint64, (_SETS, _WAYS), high=2.0**64, attribute="_sketches"),
        Array("repeats_labels", np.int16, (_SETS, _WAYS), attribute="_labels"),
    )

    def __init__(self, moves: Sequence[Action]) -> None:
        self._moves = moves
        self._pairs = np.zeros((2, 0), np.intp)
        self._sketches = np.zeros((_SETS, _WAYS), np.uint64)
        self._labels = np.zeros((_SETS, _WAYS), np.int16)  # 0 means an empty slot

    def on_example(self, lesson: TaughtExample) -> None:
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
