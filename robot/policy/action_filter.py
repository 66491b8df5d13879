"""Turns the votes on single frames into steady driving, and finds the way out of dead ends.

Every constant is a time or a share of votes, never a number of frames.

1. Votes are averaged over time. The more often the pilot changes the move, the shorter is the time
   that the average covers.
2. If the learner has no contexts, the current move goes on until another move has clearly more
   votes. If the pilot drives proportionally, a turn goes on until a turn to the other side has
   clearly more votes.
3. A straight move without effect is given up (`StallDetector`).
4. A turn loses votes once the robot has turned for longer than the pilot ever did (`Headway`).
5. If the robot alternates between left and right faster than its pilot did, it turns to only one
   side for a while.
6. If none of this helps, the robot stops and asks for help.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Self

import numpy as np
from numpy.typing import NDArray

from robot.policy.move_kinds import MoveKinds
from robot.policy.part import USUAL_STEP_S, PolicyPart, Seen
from robot.policy.pilot_pace import (
    ALTERNATING_S,
    STEP_S,
    ChangeMeter,
    Headway,
    PilotPace,
    difference,
)
from robot.types import Action, Point

VOTES_KEPT = 0.4
"""Decay factor of the running average of votes per tenth of a second."""
SHARE_OF_RUN = 0.14
"""Upper bound of the average's time constant, as a share of the time for which the pilot usually
holds a move. On a quick body a slower average would react too late."""


class RunningVotes:
    """Exponential average of the votes, so that a single frame does not change the move.

    Args:
        keep: Share of the old average that is left after a tenth of a second, in [0, 1).

    Attributes:
        kept: Weight of the old average at the last frame.
    """

    def __init__(self, keep: float) -> None:
        if not 0.0 <= keep < 1.0:
            raise ValueError(f"keep must be in [0, 1), not {keep}")
        self.keep = keep
        self.kept = 0.0
        self._average: dict[Action, float] = {}

    def update(
        self,
        shares: Mapping[Action, float],
        step_s: float = USUAL_STEP_S,
        usual_run_s: float | None = None,
    ) -> dict[Action, float]:
        """Add one frame's shares and return the average, which sums to 1.

        Args:
            shares: The votes for each move.
            step_s: Time since the last frame, in seconds.
            usual_run_s: Time for which the pilot usually holds a move; None if unknown.
        """
        keep = self.kept = self._kept(step_s if self._average else USUAL_STEP_S, usual_run_s)
        old = self._average or shares
        mixed = {
            action: keep * old.get(action, 0.0) + (1.0 - keep) * share
            for action, share in shares.items()
        }
        total = sum(mixed.values())
        self._average = {action: share / total for action, share in mixed.items()}
        return dict(self._average)

    def _kept(self, step_s: float, usual_run_s: float | None) -> float:
        if not self.keep:
            return 0.0
        constant_s = -USUAL_STEP_S / math.log(self.keep)
        if usual_run_s is not None:
            constant_s = max(min(constant_s, SHARE_OF_RUN * usual_run_s), 1e-3)
        return math.exp(-step_s / constant_s)

    def reset(self) -> None:
        """Forget the past votes, because a new drive begins."""
        self._average = {}


class StallDetector:
    """Bars a move that has no effect: the robot should move, but the image does not change.

    Pilots seldom get stuck, so the learner does not know the views of a stuck robot, and its votes
    could make the robot push indefinitely. An unchanged image or a pressed bumper shows that the
    robot is stuck. A car that starts to move changes successive images as little as a car that
    stands still. So the image must also be almost the same as when it stopped changing.

    `Headway` watches turns instead, because near a plain wall a turn changes the picture little.
    The effect of some moves, such as gripping, is unknown. The detector ignores such a move if the
    body stood still when the pilot made it.

    Attributes:
        is_stalled: True while the current move seems to have no effect.
        futile: The moves that are barred, because they had no effect.
    """

    def __init__(self, kinds: MoveKinds) -> None:
        self.is_stalled = False
        self._kinds = kinds
        self._meter = ChangeMeter()
        self._stuck_since: tuple[float, NDArray[np.uint8]] | None = None
        self.futile: list[Action] = []
        self._given_up: tuple[float, NDArray[np.uint8]] | None = None

    def look(self, seen: Seen, pace: PilotPace) -> None:
        """Process one more frame; `pace` holds the times for which this pilot pushes and turns."""
        kinds, under_way, at_s = self._kinds, seen.under_way, seen.at_s
        change = self._meter.note(seen.picture, at_s)
        if change is None:
            return
        if under_way in kinds.measured:
            self._meter.add(change)
        scale = pace.scale if pace.scale.is_known else self._meter
        is_still = scale.is_still(change)
        if under_way in kinds.straight:
            self.is_stalled = is_still or seen.bumped
        else:
            self.is_stalled = is_still and under_way in kinds.others.difference(pace.stands)
        if self._given_up is not None and not seen.bumped:
            since_s, picture = self._given_up
            # Also compare with the older picture, because in a plain corridor a turn changes the
            # picture slowly.
            is_away = not is_still or not scale.is_still(difference(seen.picture, picture))
            if is_away and at_s >= since_s + pace.away_s:
                self.lift()
        if under_way is None or not self.is_stalled:
            self._stuck_since = None
        elif self._stuck_since is None:
            self._stuck_since = at_s, seen.picture
        elif at_s - self._stuck_since[0] >= pace.patience_s - STEP_S:
            # Compare with the first picture, because the change may have been slow.
            if seen.bumped or scale.is_still(difference(seen.picture, self._stuck_since[1])):
                self.futile = [*(move for move in self.futile if move is not under_way), under_way]
                self._given_up = at_s, seen.picture
            self._stuck_since = None

    def lift(self) -> None:
        """Allow all moves again."""
        self._stuck_since = self._given_up = None
        self.futile = []

    def reset(self) -> None:
        """Forget the last drive, but not how much the picture usually changes."""
        self._meter.reset()
        self.lift()
        self.is_stalled = False


TURN_INERTIA, STRAIGHT_INERTIA = 0.3, 0.1
"""Hysteresis of turns and of all other moves: the lead in votes that another move needs to replace
the current move.

People begin a turn late and end it late, which single frames do not show. So without hysteresis the
robot ends its turns too early. Straight moves have less hysteresis, because beginning a turn too
late is worse than ending it too late (docs/explanation/learner.md).
"""
ALLOWANCE = 1.3
"""If the robot loses more time than this factor times the pilot's longest lost time (`Headway`),
its turns get fewer votes."""
HELPLESS_S = 10.0
"""The robot asks for help if it loses this much more time than `ALLOWANCE` permits, in seconds."""
ASKING_S = 5.0
"""Time for which the robot asks for help before it tries again by itself, in seconds."""


class ActionFilter(PolicyPart):
    """Turns the votes on single frames into steady driving.

    Args:
        kinds: The kinds of the moves.
        votes_kept: Decay factor of the running average of votes per tenth of a second.
        turn_inertia: Lead in votes that another move needs to replace a turn.
        straight_inertia: Lead in votes needed to replace a move that is not a turn.
        gives_up: True to give up moves without effect; the paper's robot never does.

    Attributes:
        needs_help: True while the robot stands still and asks for help, because it is stuck.
        pace: The pilot's pace.
    """

    def __init__(
        self,
        kinds: MoveKinds,
        votes_kept: float = VOTES_KEPT,
        *,
        turn_inertia: float = TURN_INERTIA,
        straight_inertia: float = STRAIGHT_INERTIA,
        gives_up: bool = True,
    ) -> None:
        self.needs_help = False
        self.turn_inertia = turn_inertia
        self.straight_inertia = straight_inertia
        self._kinds = kinds
        self._average = RunningVotes(votes_kept)
        self._stall_detector = StallDetector(kinds)
        self._headway = Headway(kinds)
        self._gives_up = gives_up
        self.pace = PilotPace(kinds)
        self._asks_until_s = 0.0
        self._last: Seen | None = None

    @classmethod
    def none(cls, kinds: MoveKinds) -> Self:
        """Return a filter without effect: each frame's votes decide, as in the paper."""
        return cls(kinds, 0.0, turn_inertia=0.0, straight_inertia=0.0, gives_up=False)

    def on_frame(self, seen: Seen) -> None:
        """Average the votes, and decide whether to change to the move with the most votes."""
        seen.shares = self._average.update(seen.shares, seen.step_s, self.pace.usual_run_s)
        seen.kept = self._average.kept
        seen.action = self._choose(seen)
        seen.is_stalled, seen.needs_help = self._stall_detector.is_stalled, self.needs_help
        self._last = seen

    def _choose(self, seen: Seen) -> Action:
        """Return the best move that is not barred; on a tie, the first of the best moves."""
        under_way, shares, turns, pace = seen.under_way, seen.shares, self._kinds.turns, self.pace
        urge = 0.0
        if self._gives_up:  # checked only if needed: comparing pictures is slow
            self._stall_detector.look(seen, pace)
            if self._last is not None:
                self._headway.turn(self._last.action, self._last.at_s)
            if under_way is None or (self.needs_help and seen.at_s >= self._asks_until_s):
                if self.needs_help:
                    self._stall_detector.lift()
                self.needs_help = False  # either the pilot drives, or the robot may try again
                self._headway.reset()
            else:
                urge = self._watch(under_way, seen.at_s, ALLOWANCE * pace.lost_limit_s)
        futile = self._stall_detector.futile
        # Alternating left and right is normal for a quick pilot, but useless for a stuck robot.
        limit_s = ALTERNATING_S if futile else pace.alternating_s
        barred = self._headway.barred_side(seen.at_s, limit_s)
        allowed = [action for action in shares if turns.get(action) != barred or barred is None]
        fruitful = [action for action in allowed if action not in futile and shares[action] > 0.0]
        if futile and not fruitful:
            self._ask(seen.at_s)  # no other move was taught, or all others are barred
        inertia = self.turn_inertia if under_way in turns else self.straight_inertia
        # Left and right turns share one context, so a context does not tell the side of a turn.
        is_proportional = seen.in_context and self._point is not None
        held = turns.get(under_way) if is_proportional and under_way is not None else None
        return max(
            fruitful or allowed or shares,
            key=lambda action: (
                shares[action]
                + (inertia if action is under_way and not seen.in_context else 0.0)
                - (inertia if held is not None and turns.get(action) == -held else 0.0)
                - (urge if action in turns else 0.0)
            ),
        )

    @property
    def _point(self) -> Point | None:
        """Steering and throttle of the last move, if it was proportional."""
        return None if self._last is None else self._last.point

    def _watch(self, under_way: Action, at_s: float, allowed_s: float) -> float:
        """Update the lost time and `needs_help`; return the votes that each turn loses."""
        is_stalled = self._stall_detector.is_stalled
        self._headway.note(under_way, at_s, self._point, is_stalled=is_stalled)
        lost_s = self._headway.lost_s
        if lost_s > allowed_s + HELPLESS_S:
            self._ask(at_s)
        return min(max((lost_s - allowed_s) / (0.5 * allowed_s), 0.0), 2.0)

    def _ask(self, at_s: float) -> None:
        if not self.needs_help:
            self.needs_help, self._asks_until_s = True, at_s + ASKING_S

    def reset(self) -> None:
        self._average.reset()
        self._stall_detector.reset()
        self._headway.reset()
        self._last = None
        self.needs_help = False
