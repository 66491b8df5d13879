"""From frame-by-frame votes to steady driving: a running average, and commitment to a turn."""

from __future__ import annotations

from collections.abc import Mapping

from robot.types import Action

OPPOSITE: dict[Action, Action] = {
    Action.LEFT: Action.RIGHT,
    Action.RIGHT: Action.LEFT,
    Action.SPIN_LEFT: Action.SPIN_RIGHT,
    Action.SPIN_RIGHT: Action.SPIN_LEFT,
}


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
    """Once turning, a robot does not turn the other way until it has driven straight.

    LEFT and RIGHT in turn lead nowhere: the opposite of the turn begun counts for nothing until
    the votes have been for neither of the two `release_frames` times in a row.
    """

    def __init__(self, release_frames: int = 1) -> None:
        self.release_frames = release_frames
        self._turn: Action | None = None
        self._straight_frames = 0

    def choose(self, shares: Mapping[Action, float]) -> Action:
        """Return the action of most votes that the turn begun allows; the first on a tie."""
        barred = OPPOSITE.get(self._turn) if self._turn is not None else None
        allowed = [action for action in shares if action is not barred] or list(shares)
        chosen = max(allowed, key=lambda action: shares[action])
        if chosen in OPPOSITE:
            self._turn = chosen
            self._straight_frames = 0
        else:
            self._straight_frames += 1
            if self._straight_frames >= self.release_frames:
                self._turn = None
        return chosen

    def reset(self) -> None:
        """Forget the turn begun: a new drive begins."""
        self._turn = None
        self._straight_frames = 0
