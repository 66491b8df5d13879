"""The paper's study: teach, correct, let it drive alone, judge. Pure; each tick brings its time.

A phase's clock runs only while the robot is in the mode that the phase needs, so a stop costs no
time of the phase. What the pilot did while teaching and what the robot did alone become two
Behavior Profiles, and their difference is the result.

Source: FLAIRS-30 (2017), experiment with human teachers: trials 1 to 3; 90 s of teaching and
330 s with corrections, or 180 s and 240 s; then 60 s alone, and a question on a 7-point scale.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from robot.control.state import Tick
from robot.errors import ConfigurationError
from robot.lab.metrics.profile import THRESHOLDS_M, Profile, behavior_profile, compare
from robot.types import Action, DrivenBy, Mode

LONGEST_STEP_S = 0.5
"""A longer gap between two ticks was a pause, and does not count."""
TEACH_AND_ALL_S = {90: 420.0, 180: 420.0}
"""Choices of teaching time, and how long teaching and corrections are together."""
ALONE_S = 60.0
SCALE = range(1, 8)

FORWARD_LEFT = (Action.FORWARD, Action.LEFT)
TRIALS: Mapping[int, tuple[str, tuple[Action, ...]]] = {
    1: ("box", FORWARD_LEFT),
    2: ("office", FORWARD_LEFT),
    3: ("office", (*FORWARD_LEFT, Action.RIGHT)),
}
"""The place and the moves of each trial."""


class Phase(StrEnum):
    """A phase of the study."""

    TEACH = "teach"
    CORRECT = "correct"
    ALONE = "alone"
    QUESTION = "question"
    DONE = "done"


_MODES = {Phase.TEACH: Mode.TRAIN, Phase.CORRECT: Mode.AUTONOMOUS, Phase.ALONE: Mode.AUTONOMOUS}
_ORDER = list(Phase)


@dataclass(slots=True)
class _Drive:
    """What one driver did: a move and a sonar reading a picture."""

    moves: list[Action] = field(default_factory=list)
    distances_m: list[float] = field(default_factory=list)

    def profile(self) -> Profile:
        return behavior_profile(self.moves, self.distances_m)


class StudyRun:
    """One guided run of the study.

    Args:
        trial: 1, 2 or 3.
        teach_s: 90 or 180 seconds of teaching.
        pace: Seconds of the study per second of the clock: 1, except in demonstrations and tests.

    Raises:
        ConfigurationError: If the trial or the teaching time is unknown.
    """

    def __init__(self, trial: int, teach_s: int, pace: float = 1.0) -> None:
        if trial not in TRIALS:
            raise ConfigurationError(f"there is no trial {trial}; choose 1, 2 or 3")
        if teach_s not in TEACH_AND_ALL_S:
            raise ConfigurationError(f"teaching takes 90 or 180 s, not {teach_s}")
        self.trial = trial
        self.place, self.moves = TRIALS[trial]
        self.wanted_s: dict[Phase, float] = {
            Phase.TEACH: float(teach_s),
            Phase.CORRECT: TEACH_AND_ALL_S[teach_s] - teach_s,
            Phase.ALONE: ALONE_S,
        }
        self.done_s: dict[Phase, float] = dict.fromkeys(self.wanted_s, 0.0)
        self.phase = Phase.TEACH
        self.answer: int | None = None
        self.interventions = 0
        self.pace = pace
        self._last_s: float | None = None
        self._was_pilot = False
        self._pilot, self._robot = _Drive(), _Drive()

    @property
    def mode(self) -> Mode | None:
        """The mode in which this phase's clock runs; None when nothing is to be driven."""
        return _MODES.get(self.phase)

    @property
    def left_s(self) -> float:
        """Seconds that are left of this phase."""
        return max(0.0, self.wanted_s.get(self.phase, 0.0) - self.done_s.get(self.phase, 0.0))

    def note(self, tick: Tick) -> bool:
        """Record one tick of the loop; True if it ended a phase, and the robot has to stop."""
        step_s = 0.0 if self._last_s is None else min(tick.now_s - self._last_s, LONGEST_STEP_S)
        self._last_s = tick.now_s
        if self.mode is None or tick.decision.mode is not self.mode:
            return False
        self._note_drive(tick)
        self.done_s[self.phase] += step_s * self.pace
        if self.left_s > 0.0:
            return False
        self.phase = _ORDER[_ORDER.index(self.phase) + 1]
        return True

    def _note_drive(self, tick: Tick) -> None:
        is_pilot = tick.decision.driven_by is DrivenBy.PILOT
        if is_pilot and not self._was_pilot and self.mode is Mode.AUTONOMOUS:
            self.interventions += 1
        self._was_pilot = is_pilot
        distance_m = tick.sensors.distance_m
        if tick.frame is None or distance_m is None or tick.sent is Action.STOP:
            return
        if self.phase is Phase.TEACH and is_pilot:
            self._pilot.moves.append(tick.sent)
            self._pilot.distances_m.append(distance_m)
        elif self.phase is Phase.ALONE and tick.decision.driven_by is DrivenBy.ROBOT:
            self._robot.moves.append(tick.sent)
            self._robot.distances_m.append(distance_m)

    def judge(self, answer: int) -> None:
        """Record the pilot's answer to the closing question.

        Raises:
            ConfigurationError: If the robot has not driven alone yet, or the answer is not 1 to 7.
        """
        if self.phase is not Phase.QUESTION:
            raise ConfigurationError("the question comes after the robot drove alone")
        if isinstance(answer, bool) or answer not in SCALE:
            raise ConfigurationError("the answer is a whole number from 1 to 7")
        self.answer = answer
        self.phase = Phase.DONE

    def result(self) -> dict[str, object]:
        """Return the result as plain values for JSON; profiles at 0, 0.02, ..., 4 m."""
        pilot, robot = self._pilot.profile(), self._robot.profile()
        difference = compare(pilot, robot, self.moves)
        is_known = bool(self._pilot.moves and self._robot.moves)
        return {
            "trial": self.trial,
            "place": self.place,
            "moves": [move.value for move in self.moves],
            "wanted_s": {phase.value: seconds for phase, seconds in self.wanted_s.items()},
            "done_s": {phase.value: round(s, 2) for phase, s in self.done_s.items()},
            "interventions": self.interventions,
            "answer": self.answer,
            "step_m": float(THRESHOLDS_M[1]),
            "pilot": _plain(pilot),
            "robot": _plain(robot),
            "pictures": {"pilot": len(self._pilot.moves), "robot": len(self._robot.moves)},
            "ssd": round(difference.ssd, 4) if is_known else None,
            "ssd_of_moves_both_made": round(difference.made, 4) if is_known else None,
            "ssd_per_move": {m.value: round(s, 4) for m, s in difference.per_move.items()},
            "never_by_pilot": [move.value for move in difference.never_by_teacher],
            "never_by_robot": [move.value for move in difference.never_by_robot],
        }


def _plain(profile: Profile) -> dict[str, list[float]]:
    return {move.value: [round(float(p), 4) for p in shares] for move, shares in profile.items()}
