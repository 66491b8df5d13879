"""What a session came to: one row for each phase, made of its event log alone. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

from robot.lab.metrics.profile import Profile, behavior_profile, compare
from robot.study.events import StudyEvent
from robot.study.plan import Condition, PhaseKind, PlannedPhase, StudyPlan
from robot.study.questions import SCORES, scores
from robot.types import Action, DrivenBy, Mode

QUESTIONS = "questions"
"""Phase and kind of the row with the answers."""
DRIVE_COLUMNS = (
    *("participant", "slot", "position", "condition", "attempt", "phase", "kind", "is_complete"),
    *(
        "world",
        "place_checked_by",
        "learner",
        "moves",
        "began_at",
        "planned_s",
        "driven_s",
        "stops",
    ),
    *("interventions", "frames_pilot", "frames_robot", "examples", "agreement", "ssd"),
    *("ssd_of_moves_both_made", "recordings"),
)
Cell = str | int | float | None
Row = Mapping[str, Cell]
_DIGITS = 6


def columns(plan: StudyPlan) -> tuple[str, ...]:
    """Return the titles of all columns: those of every study, the scores, one for each question."""
    return (*DRIVE_COLUMNS, *SCORES, *(question.name for question in plan.questions))


@dataclass(slots=True)
class PhaseLog:
    """The events of one phase, sorted."""

    events: list[StudyEvent] = field(default_factory=list)

    def count(self, event: str) -> int:
        """Count events of one kind."""
        return sum(e.event == event for e in self.events)

    def frames(self, by: DrivenBy) -> list[StudyEvent]:
        """Return the frames on which somebody drove."""
        return [e for e in self.events if e.event == "frame" and e.driven_by == by.value]

    def measure(self, name: str) -> str | None:
        """Return what was measured at the phase's end."""
        found = [e.value for e in self.events if e.event == "measure" and e.name == name]
        return found[-1] if found else None


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionLog:
    """One participant's last attempt at one condition."""

    participant: str
    slot: int
    position: int
    attempt: int
    condition: Condition
    events: Sequence[StudyEvent]
    phases: Mapping[str, PhaseLog]

    def profile(self, by: DrivenBy, *kinds: PhaseKind) -> Profile:
        """Return the Behavior Profile of who drove in phases of these kinds."""
        frames = [
            frame
            for phase in self.condition.phases
            if phase.kind in kinds
            for frame in self.phases.get(phase.name, PhaseLog()).frames(by)
        ]
        return profile_of(frames)

    def answers(self) -> dict[str, str]:
        """Return the answers by question, the last one where it was changed."""
        return {e.name: e.value for e in self.events if e.event == "answer"}

    @property
    def is_answered(self) -> bool:
        """Whether the participant finished the questions."""
        return any(e.event == "answered" for e in self.events)


def profile_of(frames: Sequence[StudyEvent]) -> Profile:
    """Return the Behavior Profile of some frames; those without a sonar reading do not count."""
    seen = [(Action(f.move), f.distance_m) for f in frames if f.distance_m is not None]
    return behavior_profile([move for move, _ in seen], [distance for _, distance in seen])


def condition_logs(
    plan: StudyPlan, participant: str, events: Sequence[StudyEvent]
) -> list[ConditionLog]:
    """Sort a session's events by condition; of a condition begun anew, the last attempt counts."""
    slot = int(events[0].value)
    found = []
    for position, name in enumerate(plan.order(slot), start=1):
        attempts = [e.attempt for e in events if e.position == position]
        if not any(attempts):
            continue
        mine = [e for e in events if e.position == position and e.attempt == max(attempts)]
        phases: dict[str, PhaseLog] = {}
        for event in mine:
            if event.phase:
                phases.setdefault(event.phase, PhaseLog()).events.append(event)
        found.append(
            ConditionLog(
                participant=participant,
                slot=slot,
                position=position,
                attempt=max(attempts),
                condition=plan.by_name[name],
                events=mine,
                phases=phases,
            )
        )
    return found


def rows_of(plan: StudyPlan, log: ConditionLog) -> Iterator[Row]:
    """Yield a row for each phase that was begun, then one with the answers."""
    teacher = log.profile(DrivenBy.PILOT, PhaseKind.TEACH)
    for phase in log.condition.phases:
        if phase.name in log.phases:
            yield {**_common(log), **_drive(log, phase, log.phases[phase.name], teacher)}
    answers = log.answers()
    if answers:
        yield {
            **_common(log),
            "phase": QUESTIONS,
            "kind": QUESTIONS,
            "is_complete": int(log.is_answered),
            "began_at": _moment(next(e for e in log.events if e.event == "answer")),
            **{name: round(score, _DIGITS) for name, score in scores(answers).items()},
            **{q.name: _plain(answers.get(q.name), q.kind) for q in plan.questions},
        }


def _common(log: ConditionLog) -> dict[str, Cell]:
    checks = [e.name for e in log.events if e.event == "world"]
    return {
        "participant": log.participant,
        "slot": log.slot + 1,
        "position": log.position,
        "condition": log.condition.name,
        "attempt": log.attempt,
        "world": log.condition.world,
        "place_checked_by": checks[-1] if checks else None,
        "learner": log.condition.learner,
        "moves": " ".join(log.condition.moves),
    }


def _drive(
    log: ConditionLog, phase: PlannedPhase, found: PhaseLog, teacher: Profile
) -> dict[str, Cell]:
    ends = [e.phase_s for e in found.events if e.phase_s is not None]
    examples, agreement = found.measure("examples"), found.measure("agreement")
    row: dict[str, Cell] = {
        "phase": phase.name,
        "kind": phase.kind.value,
        "is_complete": int(found.count("phase_ended") > 0),
        "began_at": _moment(found.events[0]),
        "planned_s": phase.seconds,
        "driven_s": max(ends, default=0.0),
        "stops": sum(
            e.event == "mode" and e.name == Mode.STOPPED.value and bool(e.phase_s)
            for e in found.events
        ),
        "interventions": found.count("intervention"),
        "frames_pilot": len(found.frames(DrivenBy.PILOT)),
        "frames_robot": len(found.frames(DrivenBy.ROBOT)),
        "examples": int(examples) if examples else None,
        "agreement": round(float(agreement), _DIGITS) if agreement else None,
        "recordings": " ".join(
            dict.fromkeys(e.value for e in found.events if e.event == "recording")
        ),
    }
    robot = profile_of(found.frames(DrivenBy.ROBOT))
    if phase.kind is not PhaseKind.TEACH and teacher and robot:
        difference = compare(teacher, robot, log.condition.moves)
        row["ssd"] = round(difference.ssd, _DIGITS)
        row["ssd_of_moves_both_made"] = round(difference.made, _DIGITS)
    return row


def _moment(event: StudyEvent) -> str:
    return datetime.fromtimestamp(event.wall_s, UTC).isoformat(timespec="milliseconds")


def _plain(answer: str | None, kind: str) -> Cell:
    return answer if answer is None or kind == "text" else int(answer)
