"""From frame-by-frame votes to steady driving: a running average, and commitment to a move."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from robot.policy.stall_detector import StallDetector
from robot.types import Action

OPPOSITE: dict[Action, Action] = {
    Action.LEFT: Action.RIGHT,
    Action.RIGHT: Action.LEFT,
    Action.SPIN_LEFT: Action.SPIN_RIGHT,
    Action.SPIN_RIGHT: Action.SPIN_LEFT,
}
VOTES_KEPT = 0.4
"""Share of the running average of votes that stays at each frame."""
TURN_INERTIA, STRAIGHT_INERTIA = 0.3, 0.1
"""By how much the votes for another move must exceed those for the turn, or other move, under way.

People begin a turn late and end it late: between the two, the same view means go on as you do.
Votes alone cannot tell, and a robot without inertia ends its turns too early. A turn begun too late
costs more than one ended too late, so a turn has more of it (docs/explanation/learner.md).
"""
UNFAMILIAR = 0.3
"""Novelty from which a robot that pushes without effect tries something else. On a view that was
taught it goes on: there the pilot meant to push."""


class RunningVotes:
    """Exponential average of the votes: one odd frame does not turn the wheels.

    Args:
        keep: Share of the old average that stays at each frame, in [0, 1).
    """

    def __init__(self, keep: float) -> None:
        if not 0.0 <= keep < 1.0:
            raise ValueError(f"keep must be in [0, 1), not {keep}")
        self.keep = keep
        self._average: dict[Action, float] = {}

    def update(self, shares: Mapping[Action, float]) -> dict[Action, float]:
        """Take in one frame's shares and return the average; it sums to 1."""
        old = self._average or shares
        mixed = {
            action: self.keep * old.get(action, 0.0) + (1.0 - self.keep) * share
            for action, share in shares.items()
        }
        total = sum(mixed.values())
        self._average = {action: share / total for action, share in mixed.items()}
        return dict(self._average)

    def reset(self) -> None:
        """Forget the past: a new drive begins."""
        self._average = {}


class Commitment:
    """A robot goes on with the move under way unless the votes for another clearly exceed it.

    And once turning, it does not turn the other way until it has chosen to drive straight: LEFT
    and RIGHT in turn lead nowhere.

    Args:
        turn_inertia: By how much the votes for another move must exceed those for a turn under way.
        straight_inertia: The same for any other move under way.
        bars_opposite: False: a turn may follow its opposite.
    """

    def __init__(
        self,
        turn_inertia: float = TURN_INERTIA,
        straight_inertia: float = STRAIGHT_INERTIA,
        *,
        bars_opposite: bool = True,
    ) -> None:
        self.turn_inertia = turn_inertia
        self.straight_inertia = straight_inertia
        self.bars_opposite = bars_opposite
        self._turn: Action | None = None

    def choose(
        self,
        shares: Mapping[Action, float],
        under_way: Action | None = None,
        futile: Action | None = None,
    ) -> Action:
        """Return the action of most votes that the turn begun allows; the first on a tie.

        Args:
            shares: The votes for each move.
            under_way: What the robot is doing by its own choice; None if it is not: what the
                pilot does must not weigh in a judgement that is compared with the pilot's.
            futile: A move that leads nowhere now: taken only if there are no votes for another.
        """
        barred = OPPOSITE.get(self._turn) if self._turn is not None else None
        allowed = [action for action in shares if action is not barred] or list(shares)
        fruitful = [action for action in allowed if action is not futile and shares[action] > 0]
        inertia = self.turn_inertia if under_way in OPPOSITE else self.straight_inertia
        chosen = max(
            fruitful or allowed,
            key=lambda action: shares[action] + (inertia if action is under_way else 0.0),
        )
        self._turn = chosen if self.bars_opposite and chosen in OPPOSITE else None
        return chosen

    def reset(self) -> None:
        """Forget the turn begun: a new drive begins."""
        self._turn = None


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """One frame, as far as steadiness goes: in grey, how new it is, when it was taken, and if a
    bumper was pressed."""

    picture: NDArray[np.uint8]
    novelty: float
    at_s: float
    bumped: bool


class ActionFilter:
    """All that lies between the votes on one frame and a steady drive.

    Args:
        votes_kept: Share of the running average of votes that stays at each frame.
        commitment: To the move under way, and to a turn begun.
        unfamiliar: Novelty from which a move that gains no way is given up; inf: never.
    """

    def __init__(
        self,
        votes_kept: float = VOTES_KEPT,
        commitment: Commitment | None = None,
        unfamiliar: float = UNFAMILIAR,
    ) -> None:
        self._average = RunningVotes(votes_kept)
        self._commitment = commitment or Commitment()
        self._stall_detector = StallDetector()
        self.unfamiliar = unfamiliar

    @classmethod
    def none(cls) -> Self:
        """Return none at all: each frame's own votes decide, as in the paper."""
        return cls(0.0, Commitment(0.0, 0.0, bars_opposite=False), math.inf)

    def average(self, shares: Mapping[Action, float]) -> dict[Action, float]:
        """Take in the votes on one more frame, and return their running average."""
        return self._average.update(shares)

    def choose(
        self, shares: Mapping[Action, float], view: View, under_way: Action | None
    ) -> Action:
        """Return what to do; `under_way` as `Commitment.choose` has it."""
        return self._commitment.choose(shares, under_way, self._futile(view, under_way))

    def _futile(self, view: View, under_way: Action | None) -> Action | None:
        """Return the move that gains no way on a view that was not taught."""
        if math.isinf(self.unfamiliar):  # on an EV3 each comparison of pictures counts
            return None
        barred = self._stall_detector.barred(view.picture, under_way, view.at_s, bumped=view.bumped)
        return barred if view.novelty >= self.unfamiliar else None

    def reset(self) -> None:
        """Forget whatever belongs to the drive that ends here."""
        self._average.reset()
        self._commitment.reset()
        self._stall_detector.reset()
