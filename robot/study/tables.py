"""The tables of a study's report, made from its rows. Pure; every digit of a number is exact."""

from __future__ import annotations

import itertools
import statistics
from collections import Counter
from collections.abc import Sequence

from robot.study.plan import StudyPlan
from robot.study.questions import SCORES
from robot.study.rows import QUESTIONS, Row
from robot.study.table import Cell, Table

_DIGITS = 6
_OF_KIND = {
    "teach": ("examples", "agreement", "stops"),
    "correct": ("interventions", "examples", "ssd", "stops"),
    "alone": ("ssd", "interventions", "stops"),
}
Measure = tuple[str, str]
"""A phase and a column."""


def measures(plan: StudyPlan) -> list[Measure]:
    """Return the measures that are compared between the conditions."""
    driven = [
        (phase.name, column)
        for phase in plan.conditions[0].phases
        for column in _OF_KIND[phase.kind]
    ]
    asked = {question.name for question in plan.questions}
    scored = [(QUESTIONS, name) for name in SCORES if any(q.startswith(name[:3]) for q in asked)]
    scales = [(QUESTIONS, q.name) for q in plan.questions if q.kind == "scale"]
    return [*driven, *scored, *scales]


def values_of(rows: Sequence[Row], condition: str, measure: Measure) -> dict[str, float]:
    """Return one measure by participant, of complete phases only."""
    phase, column = measure
    return {
        str(row["participant"]): float(value)
        for row in rows
        if row["condition"] == condition and row["phase"] == phase and row["is_complete"]
        if (value := row.get(column)) is not None and not isinstance(value, str)
    }


def make_tables(plan: StudyPlan, rows: Sequence[Row]) -> dict[str, Table]:
    tables = {
        "conditions": _conditions(plan, rows),
        "order": _order(plan, rows),
        "answers": _answers(plan, rows),
    }
    if plan.is_within and len(plan.conditions) > 1:
        tables["differences"] = _differences(plan, rows)
    return tables


def _conditions(plan: StudyPlan, rows: Sequence[Row]) -> Table:
    lines: list[tuple[Cell, ...]] = []
    for measure in measures(plan):
        for condition in plan.conditions:
            values = list(values_of(rows, condition.name, measure).values())
            lines.append((*measure, condition.name, *_summary(values)))
    head = ("phase", "measure", "condition", "n", "mean", "sd", "median", "least", "most")
    return Table(title="The conditions", columns=head, rows=tuple(lines))


def _summary(values: Sequence[float]) -> tuple[Cell, ...]:
    if not values:
        return (0, None, None, None, None, None)
    spread = statistics.stdev(values) if values[1:] else None
    ends = (statistics.median(values), min(values), max(values))
    figures = (statistics.fmean(values), spread, *ends)
    return (len(values), *(x if x is None else round(x, _DIGITS) for x in figures))


def _differences(plan: StudyPlan, rows: Sequence[Row]) -> Table:
    lines: list[tuple[Cell, ...]] = []
    for measure in measures(plan):
        for first, second in itertools.combinations(plan.conditions, 2):
            one = values_of(rows, first.name, measure)
            other = values_of(rows, second.name, measure)
            found = [other[code] - one[code] for code in sorted(one.keys() & other.keys())]
            n, mean, spread, *_ = _summary(found)
            signs = (sum(d > 0 for d in found), sum(d < 0 for d in found))
            lines.append((*measure, first.name, second.name, n, mean, spread, *signs))
    head = ("phase", "measure", "condition", "minus_from", "n", "mean", "sd", "higher", "lower")
    return Table(
        title="Differences within participants",
        columns=head,
        rows=tuple(lines),
        note="The second condition minus the first, for participants who completed both.",
    )


def _order(plan: StudyPlan, rows: Sequence[Row]) -> Table:
    met = {(str(r["participant"]), r["position"], r["condition"]) for r in rows}
    positions = range(1, len(plan.order(0)) + 1)
    lines: tuple[tuple[Cell, ...], ...] = tuple(
        (c.name, *(sum(m[1:] == (position, c.name) for m in met) for position in positions))
        for c in plan.conditions
    )
    head = ("condition", *(f"position_{position}" for position in positions))
    return Table(title="Participants by condition and position", columns=head, rows=lines)


def _answers(plan: StudyPlan, rows: Sequence[Row]) -> Table:
    lines: list[tuple[Cell, ...]] = []
    asked = [question.name for question in plan.questions if question.kind != "text"]
    for name, condition in itertools.product(asked, plan.conditions):
        given = Counter(values_of(rows, condition.name, (QUESTIONS, name)).values())
        lines += [(name, condition.name, int(answer), n) for answer, n in sorted(given.items())]
    return Table(
        title="Number of times that each answer was given",
        columns=("question", "condition", "answer", "n"),
        rows=tuple(lines),
        note="A choice is the number of its option. Free texts are only in phases.csv.",
    )
