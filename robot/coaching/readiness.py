"""Estimates whether the robot is ready to drive by itself, by short trials, not by agreement. Pure.

Agreement predicts little, since most frames are similar to the frames before them. The best
predictor of a minute alone is a short trial: the robot drives, and the pilot stays ready to
correct. The time of a trial counts while nothing goes wrong: no correction, no collision, no call
for help, and few unknown views. Before the first trial the pilot must have begun each move in use a
few times.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from robot.coaching.gaps import Gap, GapKind
from robot.coaching.lesson import CLEAN_S, FORGOTTEN_S, TAUGHT_S, Lesson

NOVEL_SHARE = 0.015
"""Largest share of hardly known views in a clean trial."""


class Stage(StrEnum):
    """The next step of the lesson."""

    TEACH = "teach"
    TRY = "try"
    READY = "ready"


class Readiness(Lesson):
    """Judges from a lesson whether the robot is ready. Call all methods on the loop's thread."""

    @property
    def stage(self) -> Stage:
        """The next step of the lesson."""
        if self._missing_to_try():
            return Stage.TEACH
        return Stage.READY if self.clean_s >= self._wanted_s else Stage.TRY

    @property
    def novel_share(self) -> float:
        """Share of `clean_s` with hardly known views."""
        return self._novel_s / self.clean_s if self.clean_s else 0.0

    @property
    def needed_s(self) -> float:
        """The required `clean_s`. More time is required if too many of the views were hardly
        known."""
        return min(self._wanted_s, FORGOTTEN_S)

    @property
    def _wanted_s(self) -> float:
        return max(CLEAN_S, self._novel_s / NOVEL_SHARE)

    @property
    def foreseen(self) -> Mapping[str, int]:
        """The number of the pilot's latest changes of move while teaching, and how many were
        foreseen."""
        return {"changes": len(self._foreseen), "foreseen": sum(self._foreseen)}

    def missing(self) -> list[Gap]:
        """Return the gaps to teach, most urgent first; empty if the robot is ready."""
        if self.stage is Stage.READY:
            return []
        return [*self._missing_to_try(), *reversed(self._gaps)]

    def _missing_to_try(self) -> list[Gap]:
        gaps = []
        if not self._is_taught:
            gaps.append(Gap(kind=GapKind.TOO_SHORT, have=self._taught_s, need=TAUGHT_S))
        for move in self._rare:
            have, need = self._starts[move], self._needs(move)
            if have < need:
                gaps.append(Gap(kind=GapKind.RARE_MOVE, move=move, have=have, need=need))
        return gaps
