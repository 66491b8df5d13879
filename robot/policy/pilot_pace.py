"""Measures how long the pilot turns, holds a move, or pushes without effect.

The robot may do so for about as long. The times depend only on the labelled frames and their
teaching times, so a policy that learns them again after an undo measures the same times.
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
"""Time after which a move without effect is given up if the pilot never pushed on purpose, in
seconds."""
STEP_S = 0.1
_STILL_SHARE = 0.25
MEMORY, _FEWEST_CHANGES = 100, 5


class ChangeMeter:
    """Measures the change of the picture within a tenth of a second, and the usual change while
    driving straight. The meter ignores turns, because compared with a quick turn, driving straight
    would look like standing still.

    Attributes:
        changes: The latest changes while driving straight; their median is the usual change.
    """

    def __init__(self) -> None:
        self.changes = ()
        self.before: NDArray[np.uint8] | None = None
        self.before_s = 0.0

    def note(self, picture: NDArray[np.uint8], at_s: float) -> float | None:
        """Return the change within 0.1 s, in grey levels per pixel; None if it is not yet due."""
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
        """True after enough measurements of how much the picture changes while driving straight."""
        return len(self._changes) >= _FEWEST_CHANGES

    def is_still(self, change: float) -> bool:
        """True if a change is as small as when the body stands still; False until `is_known`."""
        if self._usual is None and self.is_known:
            self._usual = statistics.median(self._changes)
        return self.is_known and change < _STILL_SHARE * (self._usual or 0.0)

    def add(self, change: float) -> None:
        """Record how much two pictures of a straight drive differ, unless the body stood still."""
        if not self.is_still(change):
            self._changes.append(change)
            self._usual = None

    def reset(self) -> None:
        """Forget the last picture, so that the next picture is not compared."""
        self.before = None


def difference(picture: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    """Return the mean difference of two pictures of the same shape, in grey levels per pixel."""
    apart = np.maximum(picture, other) - np.minimum(picture, other)
    return float(apart.sum()) / max(apart.size, 1)  # mean() takes twice as long as sum()


PAYS_BACK = 4.0
"""One second of driving straight reduces the lost time by this many seconds."""
EFFECT_S = 0.2
"""Driving straight reduces the lost time only after this many seconds, because the picture does not
show earlier whether the move has an effect."""
STRAIGHT_S = 0.3
"""Time for which a robot must drive straight before its earlier turns are forgotten, in seconds."""
_LONGEST_STEP_S = 0.25


class Headway:
    """Measures how much time the pilot or the robot has lost by turning and pushing.

    A second of turning counts as lost, and so does a second of pushing without effect. Each second
    of driving straight reduces the lost time by four seconds. With proportional steering, the
    milder a curve, the more of it counts as driving straight. When the lost time is 0 again, a
    `Headway` forgets the earlier turns.

    Attributes:
        lost_s: The lost time, in seconds; at least 0.
        side: The side of the last turn; None if the turns are forgotten.
        sides_s: The times of the last two changes from one side to the other.
    """

    def __init__(self, kinds: MoveKinds) -> None:
        self._kinds = kinds
        self.reset()

    def reset(self) -> None:
        """Reset the lost time, and forget all turns."""
        self.lost_s = self._straight_s = 0.0
        self._last_s: float | None = None
        self._free()

    def _free(self) -> None:
        self.side: float | None = None
        self.sides_s: list[float] = []

    def note(
        self, action: Action, at_s: float, point: Point | None = None, *, is_stalled: bool = False
    ) -> None:
        """Update the lost time for the time since the last call.

        Args:
            action: The move; STOP changes nothing.
            at_s: The current time, in seconds.
            point: The steering and throttle, if the move was driven proportionally.
            is_stalled: True if the move has no effect.
        """
        last_s, self._last_s = self._last_s, at_s
        step_s = 0.0 if last_s is None else min(max(at_s - last_s, 0.0), _LONGEST_STEP_S)
        if action in self._kinds.turns or is_stalled:
            turned = 1.0 if point is None or is_stalled else abs(point.steering)
            self.lost_s = max(0.0, self.lost_s + (2.0 * turned - 1.0) * step_s)
            self._straight_s = 0.0
        elif action is not Action.STOP:
            self._straight_s += step_s
            if self._straight_s > EFFECT_S:
                self.lost_s = max(0.0, self.lost_s - PAYS_BACK * step_s)
        if self.lost_s == 0.0 and self._straight_s >= STRAIGHT_S:
            self._free()

    def turn(self, action: Action, at_s: float) -> None:
        """Record the move's side, and the time if the side changed."""
        side = self._kinds.turns.get(action)
        if side is not None:
            if self.side == -side:
                self.sides_s = [*self.sides_s[-1:], at_s]
            self.side = side

    def barred_side(self, at_s: float, limit_s: float) -> float | None:
        """Return the side that is barred after two quick changes of side, or None."""
        if self.side is None or len(self.sides_s) < 2 or at_s - self.sides_s[0] > limit_s:
            return None
        return -self.side

    @property
    def clock(self) -> tuple[float, float, float | None]:
        """The lost time, the time driven straight since the last turn, and the last call's time."""
        return self.lost_s, self._straight_s, self._last_s

    @clock.setter
    def clock(self, values: tuple[float, float, float | None]) -> None:
        self.lost_s, self._straight_s, self._last_s = values


SHORTEST_LOST_S, LONGEST_LOST_S = 1.5, 8.0
"""Bounds of the limit on lost time (`Headway`), in seconds. Beyond the limit, turning is useless.

Half a turn about one wheel takes longer than the upper bound. A pilot who alternates between left
and right for longer than that does not get out of a corner by turning."""
_MEANT = 3
"""Number of pushes after which the pilot counts as pushing on purpose. Fewer may be mistakes."""
_PATIENCE, _LONGEST_PATIENCE_S = 1.5, 5.0
_RUNS, _FEWEST_RUNS = 64, 8
ALTERNATING_S, RUN_SHARE = 2.0, 0.75
"""Time within which two changes of side count as alternating: `ALTERNATING_S` seconds, or
`RUN_SHARE` of the usual duration of a move if that is shorter."""
AWAY_S, TURN_SHARE = 1.5, 0.6
"""Time for which a move without effect stays barred: `AWAY_S` seconds, or if shorter `TURN_SHARE`
of the pilot's longest turn. After a longer time, a quick body would face the obstacle again."""
PAUSE_S = 0.45
"""Longest pause between two examples of one manoeuvre, in seconds of teaching time."""


class PilotPace(PolicyPart):
    """Learns how long a pilot's manoeuvres take.

    Attributes:
        longest_lost_s: Longest lost time of the pilot (`Headway`), at most `LONGEST_LOST_S`.
        usual_run_s: Time for which the pilot usually holds a move; None until the pilot has changed
            the move often enough.
        scale: Change of the picture while the pilot drives straight (`MoveKinds.measured`).
        stands: The moves of unknown effect during which the pilot let the robot stand still.
    """

    counts_all = True
    fields = (
        Value("longest_debt_s", number(0.0, LONGEST_LOST_S), "longest_lost_s"),
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
        Array("picture", np.uint8, ("n_pixels",), attribute="scale.before", is_optional=True),
    )

    def __init__(self, kinds: MoveKinds) -> None:
        self.kinds = kinds
        self.longest_lost_s = 0.0
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
    def away_s(self) -> float:
        """Time for which a move without effect is barred, in seconds."""
        longest_s = self.longest_lost_s
        return min(max(TURN_SHARE * longest_s, STUCK_S), AWAY_S) if longest_s else AWAY_S

    @property
    def lost_limit_s(self) -> float:
        """The lost time beyond which further turning does not help, in seconds."""
        return max(self.longest_lost_s, SHORTEST_LOST_S)

    @property
    def patience_s(self) -> float:
        """Time for which the robot may push: 1.5 times the pilot's third longest push, bounded."""
        return min(max(STUCK_S, _PATIENCE * min(self._pushes_s)), _LONGEST_PATIENCE_S)

    @property
    def alternating_s(self) -> float:
        """Time within which two changes of side count as alternating, in seconds."""
        run_s = self.usual_run_s
        return ALTERNATING_S if run_s is None else min(ALTERNATING_S, RUN_SHARE * run_s)

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
        elif is_still or self._push_s > 0.0:  # `is_still` is None if unknown
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
        lost_s = min(self._headway.lost_s, LONGEST_LOST_S)
        self.longest_lost_s = max(self.longest_lost_s, lost_s)

    def _note_runs(self, runs_s: list[float]) -> None:
        self._runs_s = runs_s[-_RUNS:]
        is_known = len(self._runs_s) >= _FEWEST_RUNS
        self.usual_run_s = statistics.median(self._runs_s) if is_known else None

    def _end_push(self) -> None:
        self._pushes_s = sorted([*self._pushes_s, self._push_s])[-_MEANT:]
        self._push_s = 0.0

    def restored(self) -> None:
        self._note_runs(self._runs_s)
