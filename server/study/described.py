"""What pages are told of studies and sessions, as plain values."""

from __future__ import annotations

from typing import Any

from robot.devices.rig import Rig
from robot.study.session import SessionStep
from server.study.conductor import Conductor
from server.study.folder import StudyFolder
from server.study.lesson import name_of_world


def describe_study(folder: StudyFolder, name: str) -> dict[str, Any]:
    """Return a study with its sessions."""
    plan, sessions = folder.plan(name), folder.summaries(name)
    taken = {session.slot for session in sessions}
    free = next((slot for slot in range(plan.participants) if slot not in taken), None)
    return {
        "name": name,
        "title": plan.title,
        "participants": plan.participants,
        "design": "within" if plan.is_within else "between",
        "conditions": [condition.name for condition in plan.conditions],
        "next_order": None if free is None else list(plan.order(free)),
        "done": sum(session.step == SessionStep.DONE for session in sessions),
        "sessions": [
            {
                "participant": session.participant,
                "order": list(plan.order(session.slot)) if not session.fault else [],
                "step": session.step,
                "position": session.position,
                "of": session.of,
                "began_at_s": session.began_s,
                "fault": session.fault,
            }
            for session in sessions
        ],
    }


def describe_session(conductor: Conductor, rig: Rig) -> dict[str, Any] | None:
    """Return the session that is on; None if there is none."""
    session, study = conductor.session, conductor.study
    if session is None or study is None:
        return None
    condition, here = session.condition, name_of_world(rig.driver)
    return {
        "study": study,
        "title": session.plan.title,
        "participant": session.participant,
        "step": session.step.value,
        "position": min(session.position + 1, len(session.order)),
        "of": len(session.order),
        "consent": dict(session.plan.consent),
        "instructions": dict(condition.instructions),
        "world": condition.world,
        "needs_confirmation": here is None,
        "is_driving": conductor.is_driving,
        "phases": [
            {
                "kind": phase.kind.value,
                "seconds": phase.seconds,
                "done_s": _done_s(session.phase_index, index, session.done_s, phase.seconds),
                "instructions": dict(phase.instructions),
            }
            for index, phase in enumerate(condition.phases)
        ],
        "phase": session.phase_index if session.step is SessionStep.DRIVE else None,
        "questions": [question.describe() for question in session.questions]
        if session.step is SessionStep.QUESTIONS
        else [],
        "answers": dict(session.answers) if session.step is SessionStep.QUESTIONS else {},
        "fault": conductor.fault,
    }


def _done_s(now: int, index: int, done_s: float, seconds: float) -> float:
    if index == now:
        return round(done_s, 1)
    return seconds if index < now else 0.0


def describe_drive(conductor: Conductor | None) -> dict[str, Any] | None:
    """Return what is to be driven or answered, in the form of a lesson; None if nothing is."""
    session = conductor.session if conductor is not None else None
    if session is None or session.step not in (SessionStep.DRIVE, SessionStep.QUESTIONS):
        return None
    phase = session.phase
    kind = phase.kind if phase else None
    return {
        "trial": session.position + 1,
        "place": session.condition.world,
        "phase": kind.value if kind else "question",
        "mode": kind.mode.value if kind else None,
        "left_s": round(session.left_s, 1),
        "wanted_s": {},
        "done_s": {},
        "interventions": session.interventions,
        "result": None,
        "participant": session.participant,
    }
