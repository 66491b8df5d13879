"""A study's plan, read from a TOML file. Field by field in docs/reference/study.md. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Any

from robot.errors import ConfigurationError
from robot.study.order import order_of, williams_rows
from robot.study.questions import Question, Words, questionnaires
from robot.study.table_reader import TableReader
from robot.types import Action, Mode

MOST_PARTICIPANTS, MOST_CONDITIONS, MOST_PHASES, MOST_QUESTIONS = 500, 8, 12, 60
LONGEST_PHASE_S = 7200.0
CODE = re.compile(r"[A-Z]{1,3}[0-9]{1,4}")
"""A participant's code: nothing else of a person is asked for, or kept."""


class PhaseKind(StrEnum):
    """What happens in a phase."""

    TEACH = "teach"
    """The pilot drives, the robot learns."""
    CORRECT = "correct"
    """The robot drives, the pilot corrects it."""
    ALONE = "alone"
    """The robot drives, and nobody is to touch it."""

    @property
    def mode(self) -> Mode:
        """The mode in which the phase's clock runs."""
        return Mode.TRAIN if self is PhaseKind.TEACH else Mode.AUTONOMOUS


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedPhase:
    """One timed part of a condition."""

    name: str
    kind: PhaseKind
    seconds: float
    instructions: Words


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """What is compared: a place, moves, a learner, and timed phases."""

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
    """Whether a participant who has finished sees how alike they drove."""
    conditions: tuple[Condition, ...]
    questions: tuple[Question, ...]

    @cached_property
    def by_name(self) -> Mapping[str, Condition]:
        return {condition.name: condition for condition in self.conditions}

    def order(self, slot: int) -> tuple[str, ...]:
        """Return the names of the conditions for one place in the plan (from 0), in order."""
        chosen = order_of(slot, len(self.conditions), is_within=self.is_within)
        return tuple(self.conditions[i].name for i in chosen)

    @property
    def balanced_every(self) -> int:
        """The order is balanced for multiples of so many participants."""
        n = len(self.conditions)
        return len(williams_rows(n)) if self.is_within else n

    def questions_at(self, position: int, of: int) -> tuple[Question, ...]:
        """Return what is asked after the condition at `position` (from 0) of `of`."""
        is_last = position == of - 1
        return tuple(q for q in self.questions if is_last or not q.is_at_the_end)


def parse_plan(text: str, where: str = "the plan") -> StudyPlan:
    """Read a plan.

    Raises:
        ConfigurationError: If it is not one; says what is wrong, where, and what to do.
    """
    import tomllib

    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError(f"{where} is not TOML: {error}; mend that line") from error
    reader = TableReader(table, where)
    questions = _questions(reader)
    plan = StudyPlan(
        title=reader.text("title", most=100),
        participants=reader.whole("participants", 1, MOST_PARTICIPANTS, default=12),
        is_within=reader.one_of("design", ("within", "between"), default="within") == "within",
        consent=reader.words("consent"),
        shows_result=reader.one_of("result", ("hidden", "shown"), default="hidden") == "shown",
        conditions=_conditions(reader),
        questions=questions,
    )
    reader.refuse_unknown()
    return plan


def _conditions(reader: TableReader) -> tuple[Condition, ...]:
    phases = tuple(_phase(part) for part in reader.tables("phase", 1, MOST_PHASES))
    _refuse_twins(reader, "phase", [phase.name for phase in phases])
    defaults = {
        "world": reader.text("world", default="", most=200),
        "moves": reader.moves("moves", default=(Action.FORWARD, Action.LEFT, Action.RIGHT)),
        "learner": reader.learner("learner", default="default-32"),
    }
    conditions = tuple(
        _condition(part, phases, defaults)
        for part in reader.tables("condition", 1, MOST_CONDITIONS)
    )
    _refuse_twins(reader, "condition", [condition.name for condition in conditions])
    return conditions


def _phase(reader: TableReader) -> PlannedPhase:
    kind = PhaseKind(reader.one_of("kind", tuple(PhaseKind)))
    phase = PlannedPhase(
        name=reader.name("name", default=str(kind)),
        kind=kind,
        seconds=reader.number("seconds", above=0.0, most=LONGEST_PHASE_S),
        instructions=reader.words("instructions"),
    )
    reader.refuse_unknown()
    return phase


def _condition(
    reader: TableReader, phases: tuple[PlannedPhase, ...], defaults: Mapping[str, Any]
) -> Condition:
    name = reader.name("name")
    seconds = reader.table("seconds")
    own_s = {
        p.name: seconds.number(p.name, above=0.0, most=LONGEST_PHASE_S, default=p.seconds)
        for p in phases
    }
    seconds.refuse_unknown()
    condition = Condition(
        name=name,
        world=reader.text("world", default=defaults["world"] or None, most=200),
        moves=reader.moves("moves", default=defaults["moves"]),
        learner=reader.learner("learner", default=defaults["learner"]),
        instructions=reader.words("instructions"),
        phases=tuple(replace(phase, seconds=own_s[phase.name]) for phase in phases),
    )
    reader.refuse_unknown()
    return condition


def _questions(reader: TableReader) -> tuple[Question, ...]:
    built_in = questionnaires()
    names = reader.names("questionnaires", tuple(built_in), default=tuple(built_in))
    found = [question for name in names for question in built_in[name]]
    found += [_own_question(part) for part in reader.tables("question", 0, MOST_QUESTIONS)]
    _refuse_twins(reader, "question", [question.name for question in found])
    return tuple(found)


def _own_question(reader: TableReader) -> Question:
    kind = reader.one_of("kind", ("scale", "choice", "text"), default="scale")
    name, text = reader.name("name"), reader.words("text", needed=True)
    is_at_the_end = reader.one_of("when", ("each", "end"), default="each") == "end"
    more: dict[str, Any] = {"least": 0, "most": 0, "step": 0}
    if kind == "scale":
        least = reader.whole("least", 0, 100, default=1)
        most = reader.whole("most", least + 1, 100, default=max(7, least + 1))
        more = {
            "least": least,
            "most": most,
            "step": reader.whole("step", 1, most - least, default=1),
        }
        more |= {"low": reader.words("low"), "high": reader.words("high")}
    elif kind == "choice":
        more["options"] = reader.list_of_words("options", 2, 20)
    reader.refuse_unknown()
    return Question(name=name, text=text, kind=kind, is_at_the_end=is_at_the_end, **more)


def _refuse_twins(reader: TableReader, what: str, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise reader.fault(f"two of the {what}s are called {name!r}", "give each its own name")
