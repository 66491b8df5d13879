"""A trial drive: the robot drives by itself, and the pilot is ready to correct it. Pure.

A trial drive shows whether the robot is ready. Agreement is a poor predictor, because most frames
resemble the frames before them. The time of a trial drive counts while nothing goes wrong: no
correction, no collision, no call for help, and few unknown views.
"""

from __future__ import annotations

from robot.coaching.gaps import GapKind
from robot.control.state import Tick
from robot.types import Action, StopReason

CLEAN_S = 45.0
"""Time for which a robot must drive without a mistake to be ready, in seconds."""
NOVEL_SHARE = 0.015
"""Largest share of hardly known views (`HARDLY_KNOWN`) in the trial drive of a ready robot."""
HARDLY_KNOWN = 0.8
"""Novelty from which a view counts as hardly known. Above 1 the robot asks for help, and a robot
that comes near to 1 in a trial drive will probably ask later."""
PUSHED_S = 0.3
FORGOTTEN_S = 2 * CLEAN_S
"""Duration in seconds after which a trial drive's times are halved, because what the robot did long
ago says little about its present abilities."""


class TrialDrive:
    """Measures how long the robot has driven without a mistake (`clean_s`)."""

    def __init__(self) -> None:
        self.clean_s = self._novel_s = self._stalled_s = 0.0

    def note(self, tick: Tick, step_s: float) -> GapKind | None:
        """Count one tick; return what went wrong in it, or None. A collision or a call for help
        ends the trial drive; a hardly known view (`HARDLY_KNOWN`) does not."""
        prediction = tick.prediction
        if tick.decision.stop_reason is StopReason.NEEDS_HELP:
            return GapKind.HELPLESS
        if prediction is None or tick.sent is Action.STOP:
            return None
        self._stalled_s = self._stalled_s + step_s if prediction.is_stalled else 0.0
        if self._stalled_s >= PUSHED_S:
            return GapKind.PUSHED
        is_novel = prediction.novelty >= HARDLY_KNOWN
        self.clean_s += step_s
        self._novel_s += step_s if is_novel else 0.0
        if self.clean_s > FORGOTTEN_S:
            self.clean_s, self._novel_s = self.clean_s / 2, self._novel_s / 2
        return GapKind.UNKNOWN_VIEW if is_novel else None

    @property
    def is_enough(self) -> bool:
        """True if the robot is ready to drive by itself."""
        return self.clean_s >= self._wanted_s

    @property
    def novel_share(self) -> float:
        """Share of `clean_s` in which the views were hardly known (`HARDLY_KNOWN`)."""
        return self._novel_s / self.clean_s if self.clean_s else 0.0

    @property
    def needed_s(self) -> float:
        """The required `clean_s`. A robot needs more time if it hardly knew too many of the
        views."""
        return min(self._wanted_s, FORGOTTEN_S)

    @property
    def _wanted_s(self) -> float:
        return max(CLEAN_S, self._novel_s / NOVEL_SHARE)
