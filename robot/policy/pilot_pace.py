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
from robot.policy.stall_detector import MEMORY, STUCK_S, ChangeMeter, StraightScale
from robot.types import DEFAULT_MOVES, Action

SHORTEST_DEBT_S, LONGEST_DEBT_S = 1.5, 8.0
"""Bounds of the debt (`ProgressClock`) that a pilot is taken to allow himself, in seconds.

The longest is less than half a turn about one wheel takes: who turns to and fro for longer shows
no way out."""
_MEANT = 3
"""A pilot who pushed so often for so long meant it: once may be a slip."""
_PATIENCE, _LONGEST_PATIENCE_S = 1.5, 5.0
_RUNS, _FEWEST_RUNS = 64, 8
TO_AND_FRO_S, _QUICKER = 2.0, 0.75
"""Who changes sides twice within so long turns to and fro, or for a pilot who does that himself
within so much of the time that it takes him."""
PAUSE_S = 0.45
"""A longer gap of teaching time between two examples ends a manoeuvre."""


PAYS_BACK = 4.0
"""A second of driving straight pays for so many seconds of turning."""
EFFECT_S = 0.2
"""A straight move pays from here on: sooner nobody can tell if it has an effect."""
STRAIGHT_S = 0.3
"""Turns are paid back after driving straight for so long, and as long as the clock wants."""
_LONGEST_STEP_S = 0.25


class ProgressClock:
    """Counts a debt in seconds, the pilot's as the robot's: time without progress.

    Turning either way, and pushing without effect, add to it; driving straight with effect takes
    four times as much off; it is never below 0.

    Args:
        kinds: Which moves are turns.
    """

    def __init__(self, kinds: MoveKinds) -> None:
        self._kinds = kinds
        self.debt_s = 0.0
        self.straight_s = 0.0
        """For how long the robot has been driving straight with effect."""
        self._last_s: float | None = None

    def note(self, action: Action | None, at_s: float, *, is_stalled: bool = False) -> None:
        """Update the debt by the move that has been under way since the last call.

        Args:
            action: The move; None or STOP change nothing.
            at_s: Now, in seconds.
            is_stalled: True if it has no effect.
        """
        last_s, self._last_s = self._last_s, at_s
        step_s = 0.0 if last_s is None else min(max(at_s - last_s, 0.0), _LONGEST_STEP_S)
        if action is None or action is Action.STOP:
            return
        if action in self._kinds.turns or is_stalled:
            self.debt_s += step_s
            self.straight_s = 0.0
        else:
            self.straight_s += step_s
            if self.straight_s > EFFECT_S:
                self.debt_s = max(0.0, self.debt_s - PAYS_BACK * step_s)

    @property
    def is_paid(self) -> bool:
        """True if the turns are paid back."""
        return self.debt_s == 0.0 and self.straight_s >= STRAIGHT_S

    def reset(self) -> None:
        """Forget the debt: a new drive begins."""
        self.debt_s = self.straight_s = 0.0
        self._last_s = None

    @property
    def values(self) -> tuple[float, float, float | None]:
        """Debt, time straight, and the time of the last call."""
        return self.debt_s, self.straight_s, self._last_s

    @values.setter
    def values(self, values: tuple[float, float, float | None]) -> None:
        self.debt_s, self.straight_s, self._last_s = values


class SideChanges:
    """When a body changed from one side to the other, the last two times since it was freed.

    Args:
        kinds: Which moves are turns, and to which side.
    """

    def __init__(self, kinds: MoveKinds) -> None:
        self._kinds = kinds
        self.side: float | None = None
        self.at_s: list[float] = []

    def note(self, action: Action, at_s: float) -> float | None:
        """Take note of a move; return how long two changes took if this is the second."""
        side = self._kinds.turns.get(action)
        if side is None:
            return None
        is_change, self.side = self.side == -side, side
        if is_change:
            self.at_s = [*self.at_s[-1:], at_s]
        return self.at_s[1] - self.at_s[0] if is_change and len(self.at_s) == 2 else None

    def free(self) -> None:
        """Forget them: the turns are paid back."""
        self.side, self.at_s = None, []


class PilotPace(PolicyPart):
    """How long a pilot's manoeuvres take.

    Args:
        kinds: Which moves are turns, and which drive straight.

    Attributes:
        longest_debt_s: Largest debt (`ProgressClock`) of the pilot's own driving, within bounds.
        scale: How much the picture changes as he drives straight.
    """

    fields = (
        Value("longest_debt_s", number(SHORTEST_DEBT_S, LONGEST_DEBT_S), "longest_debt_s"),
        Value("pushes_s", many(number(0.0), _MEANT, _MEANT)),
        Value("push_s", number(0.0)),
        Value("runs_s", many(number(0.0), _RUNS), older=((),)),
        Value("run_s", number(0.0), older=(0.0,)),
        Value("label", optional(name), older=(None,)),
        Value("side", optional(number(-1.0, 1.0)), "_sides.side", older=(None,)),
        Value("sides_s", many(number(), 2), "_sides.at_s", older=((),)),
        Value("changes_s", many(number(0.0), _MEANT), older=((),)),
        Value("last_s", number()),
        Value("clock", row(number(0.0), number(0.0), optional(number())), "_clock.values"),
        Value("before_s", number(), "_meter.before_s", older=(0.0,)),
        Value("changes", many(number(0.0, 255.0), MEMORY), "scale.changes", older=((),)),
        Array("picture", np.uint8, ("n_pixels",), attribute="_meter.before", may_miss=True),
    )

    def __init__(self, kinds: MoveKinds | None = None) -> None:
        self.kinds = kinds or MoveKinds(DEFAULT_MOVES)
        self.longest_debt_s = SHORTEST_DEBT_S
        self.scale = StraightScale()
        self._pushes_s = [0.0] * _MEANT
        self._push_s = 0.0
        self._runs_s: deque[float] = deque(maxlen=_RUNS)
        self._run_s = 0.0
        self._label: Action | None = None
        self._last_s = 0.0
        self._sides = SideChanges(self.kinds)
        self._changes_s: list[float] = []
        self._clock = ProgressClock(self.kinds)
        self._meter = ChangeMeter()

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
        is_his_way = len(self._changes_s) == _MEANT
        return min(TO_AND_FRO_S, _QUICKER * self._changes_s[-1]) if is_his_way else TO_AND_FRO_S

    def on_example(self, lesson: Lesson) -> None:
        if lesson.at_s is not None:
            self.learn(lesson.label, lesson.picture, lesson.at_s)

    def learn(self, label: Action, picture: NDArray[np.uint8], at_s: float) -> None:
        """Update from one labelled frame.

        Args:
            label: What the pilot did.
            picture: The frame in grey, of any one shape.
            at_s: Its teaching time.
        """
        step_s, self._last_s = at_s - self._last_s, at_s
        is_going_on = 0.0 <= step_s <= PAUSE_S
        if not is_going_on:
            step_s = 0.0
            self._end_push()
            self._clock.reset()
            self._sides.free()
            self._meter.reset()
        change = self._meter.note(picture, at_s)
        is_still = None if change is None else self.scale.is_still(change)
        if label not in self.kinds.straight or is_still is False:
            self._end_push()
        elif is_still or self._push_s > 0.0:  # None: too soon to tell
            self._push_s += step_s
        if change is not None and label in self.kinds.straight:
            self.scale.add(change)
        self._run_s += step_s
        if label is not self._label or not is_going_on:
            if is_going_on and self._label is not None:
                self._runs_s.append(self._run_s)
            self._label, self._run_s = label, 0.0
        self._clock.note(label, at_s, is_stalled=self._push_s > 0.0)
        if self._clock.is_paid:
            self._sides.free()
        took_s = self._sides.note(label, at_s)
        if took_s is not None:
            self._changes_s = sorted([*self._changes_s, took_s])[:_MEANT]
        debt_s = min(self._clock.debt_s, LONGEST_DEBT_S)
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
        self._sides.at_s, self._changes_s = list(self._sides.at_s), list(self._changes_s)
