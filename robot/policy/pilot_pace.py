"""How long the pilot turns, pushes and keeps to a move: it sets how long the robot may.

Learned only from the labelled frames and their teaching time, so that learning the same examples
again after an undo gives the same values.
"""

from __future__ import annotations

import statistics
from collections import deque

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import Array, Arrays, Params, Value
from robot.learner.values import many, name, number, optional, row
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import Lesson, PolicyPart
from robot.policy.stall_detector import MEMORY, STUCK_S, ChangeMeter, Headway
from robot.types import DEFAULT_MOVES, Action, Point

SHORTEST_DEBT_S, LONGEST_DEBT_S = 1.5, 8.0
"""Bounds of the debt (`Headway`) that a pilot is taken to allow himself, in seconds.

The longest is less than half a turn about one wheel takes: who turns to and fro for longer shows
no way out."""
_MEANT = 3
"""A pilot who pushed so often for so long meant it: once may be a slip."""
_PATIENCE, _LONGEST_PATIENCE_S = 1.5, 5.0
_RUNS, _FEWEST_RUNS = 64, 8
TO_AND_FRO_S, OF_A_RUN = 2.0, 0.75
"""Who changes sides twice within so long turns to and fro; for a quick pilot, within so much of the
time for which he usually keeps to a move."""
PAUSE_S = 0.45
"""A longer gap of teaching time between two examples ends a manoeuvre."""


class PilotPace(PolicyPart):
    """How long a pilot's manoeuvres take.

    Args:
        kinds: Which moves are turns, and which drive straight.

    Attributes:
        longest_debt_s: Largest debt (`Headway`) of the pilot's own driving, within bounds.
        scale: How much the picture changes as he drives straight (`MoveKinds.measured`).
        stands: The moves by which he stood on purpose, among those that nobody knows.
    """

    fields = (
        Value("longest_debt_s", number(SHORTEST_DEBT_S, LONGEST_DEBT_S), "longest_debt_s"),
        Value("pushes_s", many(number(0.0), _MEANT, _MEANT)),
        Value("push_s", number(0.0)),
        Value("runs_s", many(number(0.0), _RUNS), older=((),)),
        Value("run_s", number(0.0), older=(0.0,)),
        Value("label", optional(name), older=(None,)),
        Value("stand_s", number(0.0), older=(0.0,)),
        Value("stands", many(name, 64), "stands", older=((),)),
        Value("last_s", number()),
        Value("clock", row(number(0.0), number(0.0), optional(number())), "_headway.clock"),
        Value("before_s", number(), "scale.before_s", older=(0.0,)),
        Value("changes", many(number(0.0, 255.0), MEMORY), "scale.changes", older=((),)),
        Array("picture", np.uint8, ("n_pixels",), attribute="scale.before", may_miss=True),
    )

    def __init__(self, kinds: MoveKinds | None = None) -> None:
        self.kinds = kinds or MoveKinds(DEFAULT_MOVES)
        self.longest_debt_s = SHORTEST_DEBT_S
        self.scale = ChangeMeter()
        self._pushes_s = [0.0] * _MEANT
        self._push_s = 0.0
        self._runs_s: deque[float] = deque(maxlen=_RUNS)
        self._run_s = 0.0
        self._label: Action | None = None
        self._last_s = 0.0
        self._stand_s = 0.0
        self.stands: list[Action] = []
        self._headway = Headway(self.kinds)

    @property
    def patience_s(self) -> float:
        """How long the robot may push: 1.5 times as long as the pilot did at least three times."""
        return min(max(STUCK_S, _PATIENCE * min(self._pushes_s)), _LONGEST_PATIENCE_S)

    @property
    def usual_run_s(self) -> float | None:
        """How long he usually keeps to a move; None before he has changed it often enough."""
        return statistics.median(self._runs_s) if len(self._runs_s) >= _FEWEST_RUNS else None

    @property
    def to_and_fro_s(self) -> float:
        """Within how long a robot that changes sides twice turns to and fro."""
        run_s = self.usual_run_s
        return TO_AND_FRO_S if run_s is None else min(TO_AND_FRO_S, OF_A_RUN * run_s)

    def on_example(self, lesson: Lesson) -> None:
        if lesson.at_s is not None:
            self.learn(lesson.label, lesson.picture, lesson.at_s, lesson.point)

    def learn(
        self,
        label: Action,
        picture: NDArray[np.uint8],
        at_s: float,
        point: Point | None = None,
    ) -> None:
        """Update from one labelled frame.

        Args:
            label: What the pilot did.
            picture: The frame in grey, of any one shape.
            at_s: Its teaching time.
            point: The move by degrees, if he meant it so.
        """
        step_s, self._last_s = at_s - self._last_s, at_s
        is_going_on = 0.0 <= step_s <= PAUSE_S
        if not is_going_on:
            step_s = 0.0
            self._end_push()
            self._headway.reset()
            self.scale.reset()
        change = self.scale.note(picture, at_s)
        is_still = None if change is None else self.scale.is_still(change)
        if label not in self.kinds.straight or is_still is False:
            self._end_push()
        elif is_still or self._push_s > 0.0:  # None: too soon to tell
            self._push_s += step_s
        if change is not None and label in self.kinds.measured:
            self.scale.add(change)
        is_same = label is self._label and is_going_on
        if label not in self.kinds.others or is_still is False or not is_same:
            self._stand_s = 0.0
        elif is_still or self._stand_s > 0.0:
            self._stand_s += step_s
        if self._stand_s >= STUCK_S and label not in self.stands:
            self.stands.append(label)
        self._run_s += step_s
        if not is_same:
            if is_going_on and self._label is not None:
                self._runs_s.append(self._run_s)
            self._label, self._run_s = label, 0.0
        self._headway.note(label, at_s, point, is_stalled=self._push_s > 0.0)
        debt_s = min(self._headway.debt_s, LONGEST_DEBT_S)
        self.longest_debt_s = max(self.longest_debt_s, debt_s)

    def _end_push(self) -> None:
        self._pushes_s = sorted([*self._pushes_s, self._push_s])[-_MEANT:]
        self._push_s = 0.0

    def upgrade(self, params: Params, arrays: Arrays) -> None:
        """Leave out what version 0.2 measured of the pilot and nothing asks for any more."""
        for key in params.keys() - {field.name for field in self.fields}:
            del params[key]

    def restored(self) -> None:
        self._runs_s = deque(self._runs_s, maxlen=_RUNS)
        self.scale.changes = deque(self.scale.changes, maxlen=MEMORY)
        self.stands = list(self.stands)
