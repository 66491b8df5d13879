"""A session's results: one row for each phase, made only from its event log. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from robot.errors import RecordingError, told_as
from robot.study.events import StudyEvent, check_begun, number_in, read_events
from robot.study.plan import Condition, PhaseKind, PlannedPhase, StudyPlan
from robot.study.plan_table import refuse_twins
from robot.study.profile import THRESHOLDS_M, Profile, behavior_profile, compare
from robot.study.questions import SCORES, scores
from robot.study.table import Cell
from robot.types import Action, DrivenBy, Mode

QUESTIONS = "questions"
"""Value of the columns `phase` and `kind` in the row that contains a participant's answers."""
DRIVE_COLUMNS = (
    *("participant", "slot", "position", "condition", "attempt", "phase", "kind", "is_complete"),
    *("world", "place_checked_by", "learner", "moves", "began_at", "planned_s", "driven_s"),
    *("stops", "interventions", "frames_pilot", "frames_robot", "examples", "agreement", "ssd"),
    *("ssd_of_moves_both_made", "recordings"),
)
Row = Mapping[str, Cell]
_DIGITS = 6


def columns(plan: StudyPlan) -> tuple[str, ...]:
    """Return the titles of all columns: the columns common to all studies, the scores, the
    questions."""
    return (*DRIVE_COLUMNS, *SCORES, *(question.name for question in plan.questions))


def refuse_same_columns(plan: StudyPlan, where: str = "the plan") -> None:
    """Raise ConfigurationError if a question of a new plan has the name of another column of
    phases.csv."""
    refuse_twins(columns(plan), "phases.csv column", where)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionLog:
    """One participant's last attempt at one condition. All rows of this attempt start with the
    values in `common`."""

    condition: Condition
    events: Sequence[StudyEvent]
    common: Row

    def profile(self, by: DrivenBy, *kinds: PhaseKind) -> Profile:
        """Return one driver's Behavior Profile (see `robot.study.profile`) in the phases of the
        given kinds."""
        names = {phase.name for phase in self.condition.phases if phase.kind in kinds}
        return profile_of(frames([e for e in self.events if e.phase in names], by))


def named(events: Sequence[StudyEvent], event: str) -> list[StudyEvent]:
    return [e for e in events if e.event == event]


def frames(events: Sequence[StudyEvent], by: DrivenBy) -> list[StudyEvent]:
    """Return the frames during which the given driver, the pilot or the robot, was driving."""
    return [e for e in named(events, "frame") if e.driven_by == by.value]


def profile_of(frames: Sequence[StudyEvent]) -> Profile:
    """Return the Behavior Profile of some frames; frames without a sonar reading do not count."""
    seen = [(Action(f.move), f.distance_m) for f in frames if f.distance_m is not None]
    return behavior_profile([move for move, _ in seen], [distance for _, distance in seen])


def condition_logs(plan: StudyPlan, participant: str, log: bytes) -> list[ConditionLog]:
    """Group a session's events by condition; only the last attempt at a condition counts. Raises
    RecordingError if the log cannot be read, or if the plan no longer has one of the log's
    conditions."""
    where = f"events/{participant}.csv"
    events = read_events(log, where)
    slot = check_begun(events, where)
    found = []
    for position in sorted({event.position for event in events if event.attempt}):
        mine = [event for event in events if event.position == position]
        attempt = max(event.attempt for event in mine)
        last = [event for event in mine if event.attempt == attempt]
        # Look up the condition by name: a changed plan may have another condition at this position.
        condition = plan.by_name.get(name := last[0].condition)
        if condition is None:
            raise RecordingError(
                f"{where}: the plan no longer has the condition {name!r}; add it again"
            )
        common: Row = {
            "participant": participant,
            "slot": slot + 1,
            "position": position,
            "condition": name,
            "attempt": attempt,
            "world": condition.world,
            "place_checked_by": next((e.name for e in reversed(named(last, "world"))), None),
            "learner": condition.learner,
            "moves": " ".join(condition.moves),
        }
        found.append(ConditionLog(condition=condition, events=last, common=common))
    return found


def rows_of(plan: StudyPlan, log: ConditionLog) -> Iterator[Row]:
    """Yield a row for each phase that was begun, then a row with the answers."""
    teacher = log.profile(DrivenBy.PILOT, "teach")
    for phase in log.condition.phases:
        if events := [event for event in log.events if event.phase == phase.name]:
            yield {**log.common, **_drive(log, phase, events, teacher)}
    # the last answer to a question counts
    given = {e.name: e.value for e in named(log.events, "answer")}
    if given:
        answers: dict[str, Cell] = {
            q.name: given.get(q.name) if q.kind == "text" else _plain(given.get(q.name, ""))
            for q in plan.questions
        }
        yield {
            **log.common,
            "phase": QUESTIONS,
            "kind": QUESTIONS,
            "is_complete": int(bool(named(log.events, "answered"))),
            "began_at": _moment(named(log.events, "answer")[0]),
            **{name: round(score, _DIGITS) for name, score in scores(answers).items()},
            **answers,
        }


def _drive(
    log: ConditionLog, phase: PlannedPhase, events: Sequence[StudyEvent], teacher: Profile
) -> dict[str, Cell]:
    measured = {e.name: e.value for e in named(events, "measure")}
    stops = [e for e in named(events, "mode") if e.name == Mode.STOPPED.value and e.phase_s]
    robots = frames(events, DrivenBy.ROBOT)
    row: dict[str, Cell] = {
        "phase": phase.name,
        "kind": phase.kind,
        "is_complete": int(bool(named(events, "phase_ended"))),
        "began_at": _moment(events[0]),
        "planned_s": phase.seconds,
        "driven_s": max((e.phase_s for e in events if e.phase_s is not None), default=0.0),
        "stops": len(stops),
        "interventions": len(named(events, "intervention")),
        "frames_pilot": len(frames(events, DrivenBy.PILOT)),
        "frames_robot": len(robots),
        "examples": _plain(measured.get("examples", "")),
        "agreement": _plain(measured.get("agreement", "")),
        "recordings": " ".join(dict.fromkeys(e.value for e in named(events, "recording"))),
    }
    robot = profile_of(robots)
    if phase.kind != "teach" and teacher and robot:
        difference = compare(teacher, robot, log.condition.moves)
        row["ssd"] = round(difference.ssd, _DIGITS)
        row["ssd_of_moves_both_made"] = round(difference.made, _DIGITS)
    return row


def outcome(log: ConditionLog) -> dict[str, Any]:
    """Return the comparison of participant and robot as plain values. The profiles are given for
    the distances 0, 0.02, ..., 4 m.

    The participant's profile comes from teaching; the robot's profile comes from its own driving.
    `ssd` is None if a profile is missing, because participant or robot made no move, or because
    there is no sonar.
    """
    moves = log.condition.moves
    pilot = log.profile(DrivenBy.PILOT, "teach")
    robot = log.profile(DrivenBy.ROBOT, "alone")
    difference = compare(pilot, robot, moves)
    examples = [e.value for e in named(log.events, "measure") if e.name == "examples"]
    return {
        "moves": list(moves),
        "examples": _plain(examples[-1]) if examples else 0,
        "interventions": len(named(log.events, "intervention")),
        "recordings": list(dict.fromkeys(e.value for e in named(log.events, "recording"))),
        "step_m": float(THRESHOLDS_M[1]),
        "pilot": {move: [round(float(p), 4) for p in shares] for move, shares in pilot.items()},
        "robot": {move: [round(float(p), 4) for p in shares] for move, shares in robot.items()},
        "ssd": round(difference.ssd, 4) if pilot and robot else None,
        "ssd_per_move": {move: round(s, 4) for move, s in difference.per_move.items()},
        "never_by_pilot": list(difference.never_by_teacher),
        "never_by_robot": list(difference.never_by_robot),
    }


def _moment(event: StudyEvent) -> str:
    return datetime.fromtimestamp(event.wall_s, UTC).isoformat(timespec="milliseconds")


def _plain(text: str) -> int | float | None:
    """Return a field of the log as a number; raises RecordingError if the field is not a number."""
    with told_as(RecordingError, "a field of a log is not a number", ValueError):
        number = number_in(text)
    return int(number) if number is not None and text.isdecimal() else number
