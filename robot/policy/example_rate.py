"""Which examples are learned: at most ten a second, whatever the camera's rate.

Frames closer together show almost nothing new. Each tenth of a second has room for one example, and
one that comes a little early takes it. So an unsteady camera teaches as much as a steady one,
and one with eleven frames a second as much as one with thirty.
"""

from __future__ import annotations

import math

from robot.learner.part import Value
from robot.learner.values import name, number, optional, row
from robot.policy.part import Lesson, PolicyPart

ROOM_S = 0.1
"""Each so many seconds have room for one example of the same label."""
EARLY_S = 0.03
"""By how much an example may come before its time: less than a frame at thirty a second, so that
there every third frame is learned."""


class ExampleRate(PolicyPart):
    """Follows the examples of one label; with another label it begins anew."""

    fields = (Value("last_learned", optional(row(number(), name)), older=(None,)),)

    def __init__(self) -> None:
        self._label: str | None = None
        self._room_from_s = 0.0

    def on_example(self, lesson: Lesson) -> None:
        lesson.is_learned = self.admits(lesson.label, lesson.at_s)

    def admits(self, label: str, at_s: float | None) -> bool:
        """Return whether to learn an example; call it once for each, in order.

        Args:
            label: Its label. The first of another label is always learned.
            at_s: Its teaching time; None: it stands for itself and is learned.
        """
        if at_s is None:
            self._label = None
            return True
        since_s = at_s - self._room_from_s if label == self._label else math.inf
        if -ROOM_S < since_s < ROOM_S - EARLY_S:
            return False
        self._label = str(label)
        self._room_from_s = self._room_from_s + ROOM_S if 0.0 < since_s < 2.0 * ROOM_S else at_s
        return True

    @property
    def _last_learned(self) -> tuple[float, str] | None:
        """Since when there was room for the last example, and its label, if there is one."""
        return None if self._label is None else (self._room_from_s, self._label)

    @_last_learned.setter
    def _last_learned(self, values: tuple[float, str] | None) -> None:
        self._room_from_s, self._label = (0.0, None) if values is None else values
