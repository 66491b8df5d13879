"""Follows a lesson tick by tick: what was taught, what the robot tried, and what went wrong. Pure.

Each mistake becomes a `Gap`: the move to show the robot, with a picture of the place. The first
trial drive does not begin before the pilot has started each move in use several times.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict, deque

from robot.coaching.gaps import Gap, GapKind, Stage
from robot.coaching.trial_drive import HARDLY_KNOWN, TrialDrive
from robot.control.state import Tick
from robot.policy.events import Replaced, Taught, Undone
from robot.types import Action, DrivenBy, Frame

TAUGHT_S = 40.0
"""Teaching time before the first trial drive, in seconds, unless it can begin early."""
EARLY_S, EARLY_STARTS, EARLY_KNOWN = 20.0, 4, 0.9
"""Conditions of an early first trial drive: 20 s of teaching, four starts of each move in use, and
a robot that knew 90 % of the views of the last ten seconds. After this teaching, robots foresee few
changes of move, but they can drive by themselves for a minute.
"""
STARTS = 3
"""Number of times that the pilot must have started each move in use before the first trial drive.
Fewer starts could be accidents."""
RARE_SHARE = 0.02
"""A move with a smaller share of the examples is rare, and the pilot must begin it `2 * STARTS`
times. If a pilot drives straight for minutes, his few turns at a wall have little weight."""
_SLIP_S, _MEANT_S = 0.35, 0.9
"""A press shorter than `_SLIP_S` seconds counts as a slip of the finger. A rare move is ignored
until its presses, without slips, have lasted `_MEANT_S` seconds in total. Without these limits the
page would ask for a move that the pilot never meant."""
_FEWEST = 5
"""A move with fewer examples than this counts as unused, whatever its share of the examples."""
BEFORE_S, AFTER_S = 0.5, 0.15
"""A change of move was foreseen if the robot proposed the new move at most `BEFORE_S` seconds
before the pilot made it, or at most `AFTER_S` seconds after."""
_LONGEST_STEP_S, _PAUSE_S = 0.25, 0.5
_COVERED_S = 10.0
_GAPS, _CHANGES = 6, 40


class Lesson:
    """Follows one robot tick by tick, and judges whether it is ready. Use it on the loop's thread.

    `trial` is the robot's drive since the last mistake, and `foreseen` says which of the pilot's
    latest changes of move the robot foresaw.
    """

    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self._taught_s = 0.0
        self._is_taught = False  # true once the pilot has taught enough for a trial drive
        self._rare: list[Action] = []  # moves of the lesson that the pilot began too few times
        self._examples: Counter[Action] = Counter()
        self._starts: Counter[Action] = Counter()
        # moves that the pilot taught while driving, not only while correcting the robot
        self._shown: set[Action] = set()
        self._meant_s: dict[Action, float] = defaultdict(float)
        self._try_s = 0.0
        self._last = (-math.inf, Action.STOP)  # the last move that was taught, and its time
        self._proposed: deque[tuple[float, Action | None]] = deque(maxlen=64)
        self.foreseen: deque[bool] = deque(maxlen=_CHANGES)
        # whether the robot knew each view of the last seconds of teaching
        self._known: deque[tuple[float, bool]] = deque()
        self._gaps: deque[Gap] = deque(maxlen=_GAPS)
        self._taken_from: Action | None = None  # the robot's move, until the pilot corrects it
        self._last_s = math.inf
        self._frame: Frame | None = None
        self.trial = TrialDrive()

    def note_carried(self) -> None:
        """Begin a new trial drive, because a person moved the robot to another place. There the
        robot has not driven yet, and the gaps of the old place do not apply."""
        self._gaps.clear()
        self.trial = TrialDrive()

    def note(self, tick: Tick) -> None:
        """Process one tick."""
        step_s = max(0.0, min(tick.now_s - self._last_s, _LONGEST_STEP_S))
        self._last_s = tick.now_s
        self._frame = tick.frame or self._frame
        if tick.frame is not None and tick.prediction is not None:
            self._proposed.append((tick.now_s, tick.prediction.action))
        for event in tick.history_events:
            if isinstance(event, Replaced):
                self._begin()
            elif isinstance(event, Undone):
                self.trial = TrialDrive()
            elif isinstance(event, Taught):
                self._note_taught(event, tick)
                if not self._is_taught:
                    needed_s = EARLY_S if self._is_covered else TAUGHT_S
                    self._is_taught = self._taught_s >= needed_s
                if not event.example.is_intervention:
                    self._shown.add(event.example.label)
                    in_use = [move for move in self.moves_in_use if move in self._shown]
                    self._rare = [move for move in in_use if self._starts[move] < self._needs(move)]
        if tick.decision.driven_by is DrivenBy.ROBOT:
            self._taken_from = tick.decision.action
            self._note_alone(tick, step_s)
        elif tick.decision.driven_by is DrivenBy.PILOT and self._taken_from is not None:
            self._note_takeover(tick)
        else:
            self._taken_from = None

    def _note_takeover(self, tick: Tick) -> None:
        """After a takeover, record the pilot's first move that differs from the robot's."""
        self.trial = TrialDrive()
        if tick.decision.action is not self._taken_from:
            self._add(GapKind.CORRECTED, tick, tick.decision.action, self._taken_from)
            self._taken_from = None

    def _note_taught(self, event: Taught, tick: Tick) -> None:
        label, (before_s, before) = event.example.label, self._last
        if tick.prediction is not None:
            self._known.append((event.at_s, tick.prediction.novelty < HARDLY_KNOWN))
            while self._known[0][0] < event.at_s - _COVERED_S:
                self._known.popleft()
        self._last = (event.at_s, label)
        self._examples[label] += 1
        step_s = event.at_s - before_s
        is_going_on = 0.0 <= step_s < _PAUSE_S
        self._taught_s += step_s if is_going_on else 0.0
        if is_going_on and label == before:
            was_slip = self._try_s < _SLIP_S
            self._try_s += step_s
            if self._try_s >= _SLIP_S:
                self._meant_s[label] += self._try_s if was_slip else step_s
            return
        self._try_s = 0.0
        self._starts[label] += 1
        if not is_going_on or event.example.is_intervention:
            return
        near = [move for at_s, move in self._proposed if tick.now_s - at_s <= BEFORE_S + AFTER_S]
        self.foreseen.append(label in near)
        if label not in near and near:
            self._add(GapKind.UNFORESEEN, tick, label, near[-1])

    def _note_alone(self, tick: Tick, step_s: float) -> None:
        kind, gaps = self.trial.note(tick, step_s), self._gaps
        is_repeated = kind is GapKind.UNKNOWN_VIEW and gaps and gaps[-1].kind is kind
        is_waiting = kind is GapKind.HELPLESS and not self.trial.clean_s
        if kind is not None and not is_repeated and not is_waiting:
            self._add(kind, tick, None, self._proposed[-1][1] if self._proposed else None)
        if kind in (GapKind.HELPLESS, GapKind.PUSHED):
            self.trial = TrialDrive()

    def _add(self, kind: GapKind, tick: Tick, move: Action | None, instead: Action | None) -> None:
        distance_m, frame = tick.sensors.distance_m, self._frame
        gap = Gap(kind=kind, move=move, instead=instead, distance_m=distance_m, frame=frame)
        self._gaps.append(gap)

    @property
    def stage(self) -> Stage:
        """The next step of the lesson."""
        if self._missing_to_try():
            return Stage.TEACH
        return Stage.READY if self.trial.is_enough else Stage.TRY

    def missing(self) -> list[Gap]:
        """Return the gaps to teach, most urgent first; empty if the robot is ready."""
        is_ready = self.stage is Stage.READY
        return [] if is_ready else [*self._missing_to_try(), *reversed(self._gaps)]

    @property
    def moves_in_use(self) -> list[Action]:
        """The moves that this pilot uses; slips of the finger do not count."""
        often = max(_FEWEST, RARE_SHARE * self._examples.total())
        return [
            move
            for move, count in self._examples.items()
            if count >= often or self._meant_s.get(move, 0.0) >= _MEANT_S
        ]

    @property
    def _is_covered(self) -> bool:
        """True if the pilot has begun each move often enough, and the robot knows most views."""
        known = [is_known for _, is_known in self._known]
        starts = [self._starts[move] for move in self.moves_in_use]
        return (
            len(starts) > 1
            and min(starts) >= EARLY_STARTS
            and sum(known) >= EARLY_KNOWN * len(known) > 0
        )

    def _missing_to_try(self) -> list[Gap]:
        gaps = []
        if not self._is_taught:
            gaps.append(Gap(kind=GapKind.TOO_SHORT, have=self._taught_s, need=TAUGHT_S))
        for move in self._rare:
            have, need = self._starts[move], self._needs(move)
            if have < need:
                gaps.append(Gap(kind=GapKind.RARE_MOVE, move=move, have=have, need=need))
        return gaps

    def _needs(self, move: Action) -> int:
        """Return the number of times that the pilot must begin this move before a trial drive."""
        is_rare = self._examples[move] < RARE_SHARE * self._examples.total()
        return 2 * STARTS if is_rare else STARTS
