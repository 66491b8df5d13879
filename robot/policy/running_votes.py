"""Running averages of votes, with a time constant: the same at any frame rate."""

from __future__ import annotations

import math
from collections.abc import Mapping

from robot.types import Action

VOTES_KEPT = 0.4
"""Share of the running average of votes that is left after a tenth of a second."""
USUAL_STEP_S = 0.1
"""Time between two frames where nothing tells it."""
SHARE_OF_RUN = 0.14
"""The time constant is at most this share of how long the pilot keeps to a move: an average that
is slower than its pilot's hand comes too late for a quick body."""


class RunningVotes:
    """Exponential average of the votes, so that a single frame does not change the move.

    Args:
        keep: Share of the old average that is left after a tenth of a second, in [0, 1).
    """

    def __init__(self, keep: float) -> None:
        if not 0.0 <= keep < 1.0:
            raise ValueError(f"keep must be in [0, 1), not {keep}")
        self.keep = keep
        self._average: dict[Action, float] = {}
        self._at_s: float | None = None

    def update(
        self,
        shares: Mapping[Action, float],
        at_s: float | None = None,
        usual_run_s: float | None = None,
    ) -> dict[Action, float]:
        """Add one frame's shares and return the average; it sums to 1.

        Args:
            shares: The votes for each move.
            at_s: When the frame was taken; None: a tenth of a second after the last.
            usual_run_s: How long the pilot keeps to a move; None if it is not known.
        """
        keep = self._kept(self._step_s(at_s), usual_run_s)
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

    def _step_s(self, at_s: float | None) -> float:
        before_s, self._at_s = self._at_s, at_s
        if at_s is None or before_s is None:
            return USUAL_STEP_S
        return max(at_s - before_s, 0.0)

    def reset(self) -> None:
        """Forget the past: a new drive begins."""
        self._average = {}
        self._at_s = None
