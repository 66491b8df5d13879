"""From frame-by-frame votes to steady driving: smoothing, hysteresis, and ways out.

Every constant is a time or a share of votes, never a number of frames.

1. Votes are averaged over time.
2. A move under way goes on until another exceeds it clearly or, with contexts, for long enough
   (`commitment.py`).
3. A straight move without effect is given up (`stall_detector.py`).
4. A turn that has gone on for longer than the pilot's own longest loses votes, and its opposite is
   barred until it has been paid back by driving straight (`progress_clock.py`).
5. FORWARD loses votes where it leads into the unknown (`unknown_ahead.py`).
6. If none of this helps, the robot stops and asks for help.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from robot.policy.commitment import Commitment
from robot.policy.progress_clock import ProgressClock, passed_s
from robot.policy.running_votes import IMAGES_KEPT, USUAL_STEP_S, VOTES_KEPT, RunningVotes
from robot.policy.stall_detector import StallDetector
from robot.policy.unknown_ahead import UnknownAhead
from robot.types import TURNS, Action

STRAIGHT_S = 0.3
"""After a turn its opposite is barred until the robot drove straight for so long."""
ALLOWANCE = 1.3
"""The robot may come to so many times the pilot's longest debt before its turns lose votes."""
HELPLESS_S = 10.0
"""After so long beyond that it stands and asks,"""
ASKING_S = 5.0
"""and if nobody takes the wheel, tries again after so long."""
_BY_THE_CLOCK = 3.0
"""Turns that end by the clock have so many times their inertia until then, and as much against them
afterwards: only votes that are all but unanimous weigh more."""
_UNTIL_CLEAR = 5.0
"""Such turns go on where the way is long free, so a view on which one begins has to be clear."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What the filter sees of a frame: grey values, time, if a bumper was pressed, and novelty."""

    picture: NDArray[np.uint8]
    at_s: float
    bumped: bool
    novelty: float = 0.0


class ActionFilter:
    """Makes steady driving of the votes on single frames.

    Args:
        votes_kept: Share of the running average of votes that is left after a tenth of a second.
        commitment: Hysteresis of the move under way and of turns.
        gives_up: False: moves without effect are not given up, as in the paper.
        images_kept: As `votes_kept`, for the votes of single images before they are averaged with
            the others.

    Attributes:
        needs_help: True while the robot stands and asks for help, because no move had effect.
    """

    def __init__(
        self,
        votes_kept: float = VOTES_KEPT,
        commitment: Commitment | None = None,
        *,
        gives_up: bool = True,
        images_kept: float = IMAGES_KEPT,
    ) -> None:
        self.needs_help = False
        self._average = RunningVotes(votes_kept)
        self._image_votes = RunningVotes(images_kept)
        self._commitment = commitment or Commitment()
        self._stall_detector = StallDetector()
        self._clock = ProgressClock()
        self._unknown = UnknownAhead()
        self._gives_up = gives_up
        self._asks_until_s = 0.0
        self._turns_since_s: float | None = None
        self._last_s: float | None = None

    @classmethod
    def none(cls) -> Self:
        """Return a filter that does nothing: each frame's own votes decide, as in the paper."""
        commitment = Commitment(0.0, 0.0, bars_opposite=False)
        return cls(0.0, commitment, gives_up=False, images_kept=0.0)

    def average(
        self,
        shares: Mapping[Action, float],
        at_s: float | None = None,
        from_images: Mapping[Action, float] | None = None,
    ) -> dict[Action, float]:
        """Add the votes on one more frame, and return their running average.

        Args:
            shares: The votes for each move; they sum to 1.
            at_s: When the frame was taken; None: a tenth of a second after the last.
            from_images: The part of them that single images voted for; None: nothing is known.
        """
        weight = sum(from_images.values()) if from_images is not None else 0.0
        if from_images is not None and weight > 0.0:
            votes = {move: part / weight for move, part in from_images.items()}
            calm = self._image_votes.update(votes, at_s)
            shares = {
                move: max(share - from_images[move], 0.0) + weight * calm[move]
                for move, share in shares.items()
            }
        return self._average.update(shares, at_s)

    def choose(
        self,
        shares: Mapping[Action, float],
        view: View,
        under_way: Action | None,
        *,
        longest_debt_s: float,
        patience_s: float,
        timed_turn_s: float | None = None,
        in_context: bool = False,
    ) -> Action:
        """Return what to do.

        Args:
            shares: The averaged votes.
            view: The frame.
            under_way: As `Commitment.choose` has it.
            longest_debt_s: The pilot's largest debt (`PilotPace`).
            patience_s: How long a straight move may be without effect.
            timed_turn_s: How long the pilot's turns take, if always as long (`PilotPace`).
            in_context: The votes are for what follows the move under way: it needs no inertia.
        """
        if not self._gives_up:  # on an EV3 each comparison of pictures counts
            if under_way not in TURNS:
                self._commitment.free()
            return self._commitment.choose(shares, under_way)
        self._stall_detector.patience_s = patience_s
        futile = self._stall_detector.barred(view.picture, under_way, view.at_s, bumped=view.bumped)
        urge = self._watch(under_way, view.at_s, ALLOWANCE * longest_debt_s)
        if futile is not None and not any(
            share > 0.0 for action, share in shares.items() if action is not futile
        ):
            self._ask(view.at_s)  # it was taught no other move
        hold = self._hold(under_way, view.at_s, timed_turn_s, 0.0 if in_context else 1.0)
        doubt = self._unknown.doubt(view.novelty, shares, under_way, view.at_s)
        stands_for_s = passed_s(self._last_s, view.at_s) if in_context else math.inf
        self._last_s = view.at_s
        return self._commitment.choose(
            shares,
            under_way,
            futile,
            urge=urge,
            doubt=doubt,
            hold=hold,
            stands_for_s=stands_for_s,
        )

    def _hold(
        self, under_way: Action | None, at_s: float, timed_s: float | None, usual: float
    ) -> float:
        """Return how many times its inertia a move has; negative for a turn whose time is over."""
        if under_way not in TURNS:
            self._turns_since_s = None
            return usual if timed_s is None else _UNTIL_CLEAR
        if self._turns_since_s is None:
            self._turns_since_s = at_s
        if timed_s is None:
            return usual
        is_over = at_s - self._turns_since_s > timed_s - 0.5 * USUAL_STEP_S
        return -_BY_THE_CLOCK if is_over else _BY_THE_CLOCK

    def _watch(self, under_way: Action | None, at_s: float, allowed_s: float) -> float:
        """Update the clock and `needs_help`; return what to subtract from the votes of turns."""
        clock = self._clock
        if under_way is None:  # the pilot drives, and knows the way out
            clock.reset()
        clock.note(under_way, at_s, is_stalled=self._stall_detector.is_stalled)
        if under_way is None or (clock.debt_s == 0.0 and clock.straight_s >= STRAIGHT_S):
            self._commitment.free()
        if under_way is None or (self.needs_help and at_s >= self._asks_until_s):
            self.needs_help = False
            clock.reset()
            self._commitment.free()
        elif clock.debt_s > allowed_s + HELPLESS_S:
            self._ask(at_s)
        return min(max((clock.debt_s - allowed_s) / (0.5 * allowed_s), 0.0), 2.0)

    def _ask(self, at_s: float) -> None:
        if not self.needs_help:
            self.needs_help, self._asks_until_s = True, at_s + ASKING_S

    @property
    def is_stalled(self) -> bool:
        """True while a straight move under way has no effect."""
        return self._stall_detector.is_stalled

    def reset(self) -> None:
        """Forget whatever belongs to the drive that ends here."""
        self._average.reset()
        self._image_votes.reset()
        self._commitment.free()
        self._stall_detector.reset()
        self._clock.reset()
        self._unknown.reset()
        self._turns_since_s = None
        self._last_s = None
        self.needs_help = False
