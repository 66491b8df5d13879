"""How long the pilot turns, pushes and keeps to a move: it sets how long the robot may.

Learned only from the labelled frames and their teaching time, so that learning the same examples
again after an undo gives the same values.
"""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import Array, Value
from robot.learner.values import many, name, number, optional, row
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import PolicyPart, TaughtExample
from robot.types import Action, Point

STUCK_S = 0.5
"""Time without effect after which a move is given up, in seconds, if the pilot never pushed on
purpose."""
STEP_S = 0.1
_STILL_SHARE = 0.25
MEMORY, _FEWEST_CHANGES = 100, 5


class ChangeMeter:
    """How much the picture changes within a tenth of a second, and usually, driving straight.

    Turns say nothing of the latter: where a turn is quick or the place is wide, driving straight
    would look still beside it.

    Attributes:
        changes: The latest changes of a straight drive; their median is the usual one.
    """

    def __init__(self) -> None:
        self.changes = ()
        self.before: NDArray[np.uint8] | None = None
        self.before_s = 0.0

    def note(self, picture: NDArray[np.uint8], at_s: float) -> float | None:
        """Return the change within a tenth of a second; None: that is not over yet."""
        before, step_s = self.before, at_s - self.before_s
        if before is not None and 0.0 <= step_s < 0.9 * STEP_S:
            return None
        self.before, self.before_s = picture, at_s
        if before is None or before.shape != picture.shape or step_s < 0.0:
            return None
        return difference(picture, before)

    @property
    def changes(self) -> Collection[float]:
        return self._changes

    @changes.setter
    def changes(self, changes: Collection[float]) -> None:
        self._changes = deque(changes, maxlen=MEMORY)
        self._usual: float | None = None

    @property
    def is_known(self) -> bool:
        """True as soon as it has seen enough of a straight drive."""
        return len(self._changes) >= _FEWEST_CHANGES

    def is_still(self, change: float) -> bool:
        """Tell whether a change is so small that the body stands; False before it has driven."""
        if self._usual is None and self.is_known:
            self._usual = statistics.median(self._changes)
        return self.is_known and change < _STILL_SHARE * (self._usual or 0.0)

    def add(self, change: float) -> None:
        """Add the change between two pictures of a straight drive, unless the body stood."""
        if not self.is_still(change):
            self._changes.append(change)
            self._usual = None

    def reset(self) -> None:
        """Compare the next picture with none."""
        self.before = None


def difference(picture: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    """Return by how much two pictures of one shape differ, in grey levels a pixel."""
    apart = np.maximum(picture, other) - np.minimum(picture, other)
    return float(apart.sum()) / max(apart.size, 1)  # mean() takes twice as long


PAYS_BACK = 4.0
"""Seconds of turning that one second of driving straight pays back."""
EFFECT_S = 0.2
"""Time after which a straight move pays back, in seconds: before, its effect cannot be seen."""
STRAIGHT_S = 0.3
"""Time of driving straight before turns are paid back, in seconds."""
_LONGEST_STEP_S = 0.25


class Headway:
    """The debt of turns and pushes that a body, taught or driven, has run up since it last got on.

    Turning either way, and pushing without effect, add to a debt in seconds; driving straight with
    effect takes four times as much off; it is never below 0. A curve by degrees gets on by what it
    lacks to full lock, and pays for as much turning. Changes from one side to the other count until
    the debt is paid.

    Attributes:
        debt_s: The debt.
        side: The side that it turned to last; None since the debt was paid.
        sides_s: When it changed sides, the last two times.
    """

    def __init__(self, kinds: MoveKinds) -> None:
        self._kinds = kinds
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self.debt_s = self._straight_s = 0.0
        self._last_s: float | None = None
        self._free()

    def _free(self) -> None:
        self.side: float | None = None
        self.sides_s: list[float] = []

    def note(
        self, action: Action, at_s: float, point: Point | None = None, *, is_stalled: bool = False
    ) -> None:
        """Update the debt by the move that has been under way since the last call.

        Args:
            action: The move; STOP changes nothing.
            at_s: Now, in seconds.
            point: The move by degrees, if it was driven so.
            is_stalled: True if it has no effect.
        """
        last_s, self._last_s = self._last_s, at_s
        step_s = 0.0 if last_s is None else min(max(at_s - last_s, 0.0), _LONGEST_STEP_S)
        if action in self._kinds.turns or is_stalled:
            turned = 1.0 if point is None or is_stalled else abs(point.steering)
            self.debt_s = max(0.0, self.debt_s + (2.0 * turned - 1.0) * step_s)
            self._straight_s = 0.0
        elif action is not Action.STOP:
            self._straight_s += step_s
            if self._straight_s > EFFECT_S:
                self.debt_s = max(0.0, self.debt_s - PAYS_BACK * step_s)
        if self.debt_s == 0.0 and self._straight_s >= STRAIGHT_S:
            self._free()

    def turn(self, action: Action, at_s: float) -> None:
        """Take note of a move, and of when it changed sides."""
        side = self._kinds.turns.get(action)
        if side is not None:
            if self.side == -side:
                self.sides_s = [*self.sides_s[-1:], at_s]
            self.side = side

    @property
    def clock(self) -> tuple[float, float, float | None]:
        """Debt, time straight with effect, and the time of the last call."""
        return self.debt_s, self._straight_s, self._last_s

    @clock.setter
    def clock(self, values: tuple[float, float, float | None]) -> None:
        self.debt_s, self._straight_s, self._last_s = values


SHORTEST_DEBT_S, LONGEST_DEBT_S = 1.5, 8.0
"""Bounds of the debt (`Headway`) that a pilot is taken to allow himself, in seconds.

The longest is less than half a turn about one wheel takes: a pilot who alternates between left and
right for longer shows no way out."""
_MEANT = 3
"""Number of equally long pushes after which the pilot is taken to push on purpose: one may be a
slip."""
_PATIENCE, _LONGEST_PATIENCE_S = 1.5, 5.0
_RUNS, _FEWEST_RUNS = 64, 8
TO_AND_FRO_S, OF_A_RUN = 2.0, 0.75
"""Two changes of side within this time count as alternating: in seconds, and for a quick pilot as a
share of the time for which he usually keeps to a move."""
PAUSE_S = 0.45
"""A longer gap of teaching time between two examples ends a manoeuvre."""


class PilotPace(PolicyPart):
    """How long a pilot's manoeuvres take.

    Attributes:
        longest_debt_s: Largest debt (`Headway`) of the pilot's own driving, within bounds.
        usual_run_s: How long he usually keeps to a move; None before he changed it often enough.
        scale: How much the picture changes as he drives straight (`MoveKinds.measured`).
        stands: The moves by which he stood on purpose, among those that nobody knows.
    """

    fields = (
        Value("longest_debt_s", number(SHORTEST_DEBT_S, LONGEST_DEBT_S), "longest_debt_s"),
        Value("pushes_s", many(number(0.0), _MEANT, _MEANT)),
        Value("push_s", number(0.0)),
        Value("runs_s", many(number(0.0), _RUNS)),
        Value("run_s", number(0.0)),
        Value("label", optional(name)),
        Value("stand_s", number(0.0)),
        Value("stands", many(name), "stands"),
        Value("last_s", number()),
        Value("clock", row(number(0.0), number(0.0), optional(number())), "_headway.clock"),
        Value("before_s", number(), "scale.before_s"),
        Value("changes", many(number(0.0, 255.0), MEMORY), "scale.changes"),
        Array("picture", np.uint8, ("n_pixels",), attribute="scale.before", may_miss=True),
    )

    def __init__(self, kinds: MoveKinds) -> None:
        self.kinds = kinds
        self.longest_debt_s = SHORTEST_DEBT_S
        self.scale = ChangeMeter()
        self._pushes_s = [0.0] * _MEANT
        self._push_s = 0.0
        self._runs_s: list[float] = []
        self.usual_run_s: float | None = None
        self._run_s = 0.0
        self._label: Action | None = None
        self._last_s = 0.0
        self._stand_s = 0.0
        self.stands: list[Action] = []
        self._headway = Headway(kinds)

    @property
    def patience_s(self) -> float:
        """How long the robot may push: 1.5 times as long as the pilot did at least three times."""
        return min(max(STUCK_S, _PATIENCE * min(self._pushes_s)), _LONGEST_PATIENCE_S)

    @property
    def to_and_fro_s(self) -> float:
        """Time within which two changes of side count as alternating, in seconds."""
        run_s = self.usual_run_s
        return TO_AND_FRO_S if run_s is None else min(TO_AND_FRO_S, OF_A_RUN * run_s)

    def on_example(self, lesson: TaughtExample) -> None:
        label, at_s = lesson.label, lesson.at_s
        if at_s is None:
            return
        step_s, self._last_s = at_s - self._last_s, at_s
        is_going_on = 0.0 <= step_s <= PAUSE_S
        if not is_going_on:
            step_s = 0.0
            self._end_push()
            self._headway.reset()
            self.scale.reset()
        change = self.scale.note(lesson.picture, at_s)
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
                self._note_runs([*self._runs_s, self._run_s])
            self._label, self._run_s = label, 0.0
        self._headway.note(label, at_s, lesson.point, is_stalled=self._push_s > 0.0)
        debt_s = min(self._headway.debt_s, LONGEST_DEBT_S)
        self.longest_debt_s = max(self.longest_debt_s, debt_s)

    def _note_runs(self, runs_s: list[float]) -> None:
        self._runs_s = runs_s[-_RUNS:]
        is_known = len(self._runs_s) >= _FEWEST_RUNS
        self.usual_run_s = statistics.median(self._runs_s) if is_known else None

    def _end_push(self) -> None:
        self._pushes_s = sorted([*self._pushes_s, self._push_s])[-_MEANT:]
        self._push_s = 0.0

    def restored(self) -> None:
        self._note_runs(self._runs_s)
