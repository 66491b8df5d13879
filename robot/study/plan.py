"""A study's plan, read from a TOML file. docs/reference/study.md describes its fields. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from robot.devices.raw_value import must_be, number, text, whole
from robot.errors import ConfigurationError, did_you_mean, told_as
from robot.study.plan_table import PlanTable, Words, refuse_twins, refuse_unknown, words
from robot.study.questions import Question, questionnaires
from robot.types import Action, Mode

MOST_PARTICIPANTS, MOST_CONDITIONS, MOST_PHASES, MOST_QUESTIONS = 500, 8, 12, 60
LONGEST_PHASE_S = 7200.0
CODE = re.compile(r"[A-Z]{1,3}[0-9]{1,4}")
"""Form of a participant's code. A study stores this code instead of any personal data."""
_MOVES = 'a list of moves such as ["forward", "left"]'


PhaseKind = Literal["teach", "correct", "alone"]
"""`teach`: the pilot drives and the robot learns; `correct`: the robot drives and the pilot
corrects it; `alone`: the robot drives without help."""


class PlannedPhase(PlanTable):
    """One timed part of a condition."""

    kind: PhaseKind = must_be("'teach', 'correct' or 'alone'")
    name: str = text("")
    seconds: float = number(above=0, most=LONGEST_PHASE_S)
    instructions: Words = words({})

    @property
    def mode(self) -> Mode:
        """The robot's mode during the phase. The phase's clock runs only in this mode."""
        return Mode.TRAIN if self.kind == "teach" else Mode.AUTONOMOUS


class _Condition(PlanTable):
    """A table [[condition]] of a plan; fields that it omits are taken from the top of the plan."""

    name: str = text()
    world: str = text("")
    moves: list[str] = must_be(_MOVES, [])
    learner: str = text("")
    seconds: dict[str, float] = must_be("times by phase: { teach = 90, ... }", {})
    instructions: Words = words({})


class _Plan(PlanTable):
    """The fields of a plan's file, before its tables are read."""

    title: str = text(most=100)
    participants: int = whole(12, least=1, most=MOST_PARTICIPANTS)
    design: Literal["within", "between"] = must_be("'within' or 'between'", "within")
    consent: Words = words({})
    world: str = text("")
    moves: list[str] = must_be(_MOVES, ["forward", "left", "right"])
    learner: str = text("default-32")
    result: Literal["hidden", "shown"] = must_be("'hidden' or 'shown'", "hidden")
    questionnaires: list[str] = must_be("a list of names", list(questionnaires()))
    phase: list[dict[str, Any]] = must_be("tables, each below a line [[phase]]")
    condition: list[dict[str, Any]] = must_be("tables, each below a line [[condition]]")
    question: list[dict[str, Any]] = must_be("tables, each below a line [[question]]", [])

    def check_together(self) -> None:
        for name in self.questionnaires:
            if name not in questionnaires():
                hint = did_you_mean(name, questionnaires())
                there = ", ".join(questionnaires())
                raise ValueError(f"no questionnaire is named {name!r}{hint}; choose from: {there}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One condition of the comparison: a place, moves, a learner, and timed phases."""

    name: str
    world: str
    moves: tuple[Action, ...]
    learner: str
    instructions: Words
    phases: tuple[PlannedPhase, ...]


@dataclass(frozen=True, kw_only=True)
class StudyPlan:
    """A whole study."""

    title: str
    participants: int
    is_within: bool
    consent: Words
    shows_result: bool
    """True if participants see their result at the end of the session."""
    conditions: tuple[Condition, ...]
    questions: tuple[Question, ...]

    @cached_property
    def by_name(self) -> Mapping[str, Condition]:
        return {condition.name: condition for condition in self.conditions}

    def order(self, slot: int) -> tuple[str, ...]:
        """Return the names of the conditions in one participant's order. `slot` is the
        participant's number in the study, from 0."""
        return tuple(self.conditions[i].name for i in self._orders[slot % self.balanced_every])

    @property
    def balanced_every(self) -> int:
        """The order is balanced if the number of participants is a multiple of this number."""
        return len(self._orders)

    @cached_property
    def _orders(self) -> list[tuple[int, ...]]:
        n = len(self.conditions)
        return williams_rows(n) if self.is_within else [(i,) for i in range(n)]

    def questions_at(self, position: int, of: int) -> tuple[Question, ...]:
        """Return the questions to ask after a condition. `position` is the place of the condition
        in the participant's order, from 0, and `of` is the number of conditions."""
        is_last = position == of - 1
        return tuple(q for q in self.questions if is_last or q.when == "each")


def williams_rows(n: int) -> list[tuple[int, ...]]:
    """Return orders of `n` conditions (numbered from 0), to be given to the participants in turn.
    The orders form a Williams design, a balanced Latin square.

    Every condition is at every position equally often, and follows every other condition equally
    often. An even number of conditions needs one square; an odd number also needs its mirror image.
    Source: E. J. Williams, "Experimental designs balanced for the estimation of residual effects of
    treatments", Australian Journal of Scientific Research A 2 (1949).
    """
    first = [0] + [(k + 1) // 2 if k % 2 else n - k // 2 for k in range(1, n)]
    rows = [tuple((start + i) % n for start in first) for i in range(n)]
    return rows if n % 2 == 0 or n == 1 else rows + [row[::-1] for row in rows]


def parse_plan(text: str, where: str = "the plan") -> StudyPlan:
    """Parse a plan. A ConfigurationError says what is wrong, where, and what to do."""
    import tomllib

    wrong = f"{where} is not TOML"
    with told_as(ConfigurationError, wrong, ValueError, RecursionError, do="fix that line"):
        table = tomllib.loads(text.removeprefix("\ufeff"))
    plan = _Plan.read(table, where)
    named = [{"name": phase.get("kind"), **phase} for phase in plan.phase]
    phases = PlannedPhase.read_all(named, where, "phase", 1, MOST_PHASES)
    refuse_twins([phase.name for phase in phases], "phase", where)
    own = _Condition.read_all(plan.condition, where, "condition", 1, MOST_CONDITIONS)
    refuse_twins([condition.name for condition in own], "condition", where)
    chosen = dict.fromkeys(plan.questionnaires)
    questions = [question for name in chosen for question in questionnaires()[name]]
    questions += Question.read_all(plan.question, where, "question", 0, MOST_QUESTIONS)
    refuse_twins([question.name for question in questions], "question", where)
    return StudyPlan(
        title=plan.title,
        participants=plan.participants,
        is_within=plan.design == "within",
        consent=plan.consent,
        shows_result=plan.result == "shown",
        conditions=tuple(
            _condition(plan, phases, condition, f"{where}, [[condition]] number {number}")
            for number, condition in enumerate(own, start=1)
        ),
        questions=tuple(questions),
    )


def _condition(
    plan: _Plan, phases: Sequence[PlannedPhase], own: _Condition, where: str
) -> Condition:
    world = own.world or plan.world
    if not world:
        raise ConfigurationError(f"{where}: 'world' is missing; add it")
    refuse_unknown(own.seconds, [phase.name for phase in phases], f"{where}, seconds")
    timed = [
        {**dict(phase), "seconds": own.seconds.get(phase.name, phase.seconds)} for phase in phases
    ]
    return Condition(
        name=own.name,
        world=world,
        moves=tuple(dict.fromkeys(map(Action, own.moves or plan.moves))),
        learner=own.learner or plan.learner,
        instructions=own.instructions,
        phases=tuple(PlannedPhase.read(phase, f"{where}, seconds") for phase in timed),
    )
