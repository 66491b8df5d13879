"""Simulated pilots who differ like people, in regularity, speed, side, slips and aim.

A `Habit` is a teacher, a model of human delays and a takeover policy. `drivelesson experiment
habits` teaches robots with all habits, so that results do not depend on one kind of pilot.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from robot.lab.simulated_pilots.behaviours import WallFollower
from robot.lab.simulated_pilots.hand import PRACTISED, HumanDelayConfig
from robot.lab.simulated_pilots.pilot import LENIENT, SimulatedPilot, TakeoverPolicy
from robot.lab.simulated_pilots.situation import Situation
from robot.lab.simulated_pilots.teachers import (
    TEACHER_PARAMS,
    Steerer,
    Teacher,
    TeacherParams,
    Wanderer,
)
from robot.types import Action

BOTH = (Action.LEFT, Action.RIGHT)


class Person(Wanderer):
    """A teacher that wanders like a person: each turn begins and ends a little differently.

    Args:
        params: Contain the mean distances at which the person begins and ends a turn.
        irregularity: Standard deviation of these distances, as a share of the mean.
        overshoot_s: Mean time by which the person ends a turn too late. The time is exponentially
            distributed.
    """

    def __init__(
        self,
        turns: tuple[Action, ...],
        seed: str,
        params: TeacherParams = TEACHER_PARAMS["usual"],
        *,
        irregularity: float = 0.1,
        overshoot_s: float = 0.1,
    ) -> None:
        super().__init__(turns, params)
        self._aim, self._irregularity, self._overshoot_s = params, irregularity, overshoot_s
        self._chance = random.Random(f"{seed} person")
        self._on_until_s: float | None = None

    def choose(self, situation: Situation) -> Action:
        """Return FORWARD or the current turn; turns last slightly too long."""
        turning = self._turning
        wanted = super().choose(situation)
        if turning is not None and wanted is Action.FORWARD:
            if self._on_until_s is None:
                extra_s = self._chance.expovariate(1.0) * self._overshoot_s
                self._on_until_s = situation.at_s + min(extra_s, 4 * self._overshoot_s)
            if situation.at_s < self._on_until_s:
                self._turning = turning
                return turning
            self._vary()
        self._on_until_s = None
        return wanted

    def _vary(self) -> None:
        def about(value: float) -> float:
            return value * min(max(self._chance.gauss(1.0, self._irregularity), 0.5), 1.8)

        self.params = replace(
            self._aim, turn_at_m=about(self._aim.turn_at_m), go_at_m=about(self._aim.go_at_m)
        )


class Bouncer(Wanderer):
    """Drives until something is near, then turns to a random side for a random time."""

    SHORTEST_S, LONGEST_S = 2.0, 8.0

    def __init__(self, turns: tuple[Action, ...], seed: str) -> None:
        super().__init__(turns)
        self._chance = random.Random(f"{seed} bouncer")
        self._until_s = 0.0

    def choose(self, situation: Situation) -> Action:
        is_near = situation.free_ahead_m < self.params.turn_at_m
        if self._turning is None and is_near:
            self._turning = self._chance.choice(list(self._turns.values()))
            self._until_s = situation.at_s + self._chance.uniform(self.SHORTEST_S, self.LONGEST_S)
        elif self._turning is not None and situation.at_s >= self._until_s and not is_near:
            self._turning = None
        return self._turning or Action.FORWARD


@dataclass(frozen=True, slots=True, kw_only=True)
class Habit:
    """The way in which one kind of pilot teaches."""

    teacher: Callable[[tuple[Action, ...], str], Teacher] = Person
    """Function that makes the teacher. Its arguments are the turns that the teacher may make, and a
    seed."""
    hand: HumanDelayConfig = PRACTISED
    takeover: TakeoverPolicy = LENIENT
    turns: tuple[Action, ...] = BOTH

    @property
    def moves(self) -> tuple[Action, ...]:
        return (Action.FORWARD, *self.turns)

    def pilot(self, seed: str) -> SimulatedPilot:
        teacher = self.teacher(self.turns, seed)
        return SimulatedPilot(
            teacher, self.moves, hand=self.hand, takeover=self.takeover, seed=seed
        )


HABITS: Mapping[str, Habit] = {
    "regular": Habit(teacher=partial(Person, irregularity=0.03, overshoot_s=0.0)),
    "early": Habit(teacher=partial(Person, params=TEACHER_PARAMS["early"])),
    "late": Habit(teacher=partial(Person, params=TEACHER_PARAMS["late"])),
    "left": Habit(turns=(Action.LEFT,)),
    "right": Habit(turns=(Action.RIGHT,)),
    "irregular": Habit(teacher=partial(Person, irregularity=0.3, overshoot_s=0.3)),
    "overshoots": Habit(teacher=partial(Person, overshoot_s=1.0)),
    "sloppy": Habit(
        hand=HumanDelayConfig(reaction_s=0.3, tremors_per_min=20.0, tremor_s=0.3, looks_hz=7.0)
    ),
    "hesitant": Habit(
        hand=HumanDelayConfig(reaction_s=0.25, pauses_per_min=8.0, pause_s=1.2, looks_hz=5.0)
    ),
    "slow": Habit(
        teacher=partial(Person, params=replace(TEACHER_PARAMS["usual"], turn_at_m=0.30)),
        hand=HumanDelayConfig(reaction_s=0.35, lapses_per_min=3.0, looks_hz=5.0),
    ),
    "wall": Habit(
        teacher=lambda turns, seed: WallFollower(),
        hand=HumanDelayConfig(looks_hz=8.0),
    ),
    "bouncer": Habit(
        teacher=Bouncer,
        hand=HumanDelayConfig(looks_hz=7.0),
        takeover=TakeoverPolicy(lenience=0.8),
    ),
}
"""Twelve pilots by name."""
STEERED: Mapping[str, Habit] = {
    "degrees": Habit(teacher=lambda turns, seed: Steerer(turns)),
    "cut to moves": Habit(teacher=lambda turns, seed: Steerer(turns, is_cut=True)),
}
"""A pilot who steers proportionally, and the same pilot on a body that accepts only moves."""
