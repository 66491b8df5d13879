"""What pages are told of studies and sessions, as plain values."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from robot.study.session import SessionStep
from server.study.conductor import Conductor
from server.study.folder import StudyFolder


def describe_study(folder: StudyFolder, name: str) -> dict[str, Any]:
    plan, sessions = folder.plan(name), folder.summaries(name)
    free = set(range(plan.participants)) - {session.slot for session in sessions}
    return {
        "name": name,
        "title": plan.title,
        "participants": plan.participants,
        "design": "within" if plan.is_within else "between",
        "conditions": [condition.name for condition in plan.conditions],
        "shows_result": plan.shows_result,
        "next_order": list(plan.order(min(free))) if free else None,
        "done": sum(session.step == SessionStep.DONE for session in sessions),
        "sessions": [asdict(session) for session in sessions],
    }


def describe_place(conductor: Conductor) -> dict[str, Any] | None:
    """Return where the session that is on stands: all that a viewer gets; None without one."""
    session = conductor.session
    if session is None:
        return None
    phase = session.phase
    return {
        "step": session.step.value,
        "position": min(session.position + 1, len(session.order)),
        "of": len(session.order),
        "kind": phase.kind if phase else None,
        "mode": phase.mode.value if phase else None,
        "left_s": round(session.left_s, 1),
    }


def describe_session(conductor: Conductor) -> dict[str, Any] | None:
    """Return all of the session that is on, for who conducts it; None without one."""
    session, place = conductor.session, describe_place(conductor)
    if session is None or place is None:
        return None
    condition, is_asked = session.condition, session.step is SessionStep.QUESTIONS
    return {
        **place,
        "study": conductor.study,
        "title": session.plan.title,
        "participant": session.participant,
        "consent": dict(session.plan.consent),
        "instructions": dict(condition.instructions),
        "world": condition.world,
        "needs_confirmation": not conductor.is_simulated,
        "is_driving": conductor.is_driving,
        "phases": [
            {
                "kind": phase.kind,
                "seconds": phase.seconds,
                "done_s": round(session.done_s, 1)
                if index == session.phase_index
                else phase.seconds * (index < session.phase_index),
                "instructions": dict(phase.instructions),
            }
            for index, phase in enumerate(condition.phases)
        ],
        "phase": session.phase_index if session.phase else None,
        "questions": [dict(question) for question in session.questions] if is_asked else [],
        "answers": dict(session.answers) if is_asked else {},
        "shows_result": session.plan.shows_result,
        "fault": conductor.fault,
    }
