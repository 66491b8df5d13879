"""`/api/studies` and `/api/session`: studies with participants. See docs/reference/http.md."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Literal

from fastapi import APIRouter, Depends, HTTPException, Request, Response

from robot.devices.raw_value import RawValue, must_be, text, whole
from robot.errors import ConfigurationError
from robot.study.builtin import paper_plan
from robot.study.session import SessionStep
from server.gateway.guard import role_of
from server.gateway.roles import Role
from server.routes.answers import Route, attachment, media
from server.services import Extension, Services, persistence_of, services_of
from server.study.conductor import Conductor
from server.study.folder import StudyFolder

router = APIRouter(prefix="/api", route_class=Route)


class NewStudy(RawValue):
    """A request's body: a new study. Its plan is a TOML text, or the built-in plan of trial 1, 2 or
    3."""

    name: str = text()
    plan: str | None = text(None, most=100_000)
    trial: Literal[1, 2, 3] | None = must_be("1, 2 or 3", None)


class NewSession(RawValue):
    """A request's body: either a study and a participant, or the number of one of the paper's
    trials and its teaching time."""

    study: str = text("")
    participant: str = text("")
    trial: int | None = whole(None)
    teach_s: int | None = whole(None)


class Consent(RawValue):
    """A request's body: the language in which the participant has consented."""

    language: str = text()


class ConditionStart(RawValue):
    """A request's body: `confirmed` and `anew`, see `Conductor.drive`."""

    confirmed: bool = must_be("true or false", False)
    anew: bool = must_be("true or false", False)


class Answers(RawValue):
    """A request's body: answers by question; with `done`, no answer may be missing."""

    answers: dict[str, Any] = must_be("an object of answers by question", {})
    done: bool = must_be("true or false", False)


def describe_study(folder: StudyFolder, name: str) -> dict[str, Any]:
    plan, sessions = folder.plan(name), folder.summaries(name)
    free = folder.free_slots(name, plan)
    return {
        "name": name,
        "title": plan.title,
        "participants": plan.participants,
        "design": "within" if plan.is_within else "between",
        "conditions": [condition.name for condition in plan.conditions],
        "shows_result": plan.shows_result,
        "next_order": list(plan.order(free[0])) if free else None,
        "done": sum(session.step == SessionStep.DONE for session in sessions),
        "sessions": [asdict(session) for session in sessions],
    }


def describe_place(conductor: Conductor) -> dict[str, Any] | None:
    """Return the part of the current session that a viewer may see; None if there is none."""
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
    """Return the whole state of the current session; None if there is no session."""
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


_RESUME = ConditionStart()


def _require_pilot(request: Request) -> None:
    """Refuse a viewer, because only pilots and the teacher may see studies."""
    if not (role := role_of(request)).may_change:
        raise HTTPException(403, role.refusal)


PILOT = Depends(_require_pilot)


def _conductor(request: Request) -> Conductor:
    persistence_of(request)  # answers 503 if the server has no data folder
    conductor = services_of(request).extension(StudyExtension).conductor
    assert conductor is not None
    return conductor


@router.get("/studies", dependencies=[PILOT])
def list_studies(request: Request) -> dict[str, Any]:
    """List the studies by their names."""
    return {"studies": _conductor(request).folder.names()}


@router.post("/studies", dependencies=[PILOT], status_code=201)
def create_study(request: Request, body: NewStudy) -> dict[str, str]:
    """Create a study from a given plan, or from the plan of one of the paper's trials."""
    plan = body.plan if body.trial is None else paper_plan(body.trial)
    if plan is None:
        raise ConfigurationError("send either 'plan' (a TOML text) or 'trial' (1, 2 or 3)")
    return {"name": _conductor(request).folder.create(body.name, plan)}


@router.get("/studies/{name}", dependencies=[PILOT])
def show_study(request: Request, name: str) -> dict[str, Any]:
    """Return a study, its sessions, and the next participant's order of conditions."""
    return describe_study(_conductor(request).folder, name)


@router.get("/studies/{name}/zip", dependencies=[PILOT], **media("application/zip"))
def download_study(request: Request, name: str) -> Response:
    """Return a zip file with the plan, the event logs and the table of a study."""
    return attachment(_conductor(request).folder.zip(name), "application/zip", f"{name}.zip")


@router.get("/studies/{name}/sessions/{participant}", dependencies=[PILOT])
def show_outcomes(request: Request, name: str, participant: str) -> dict[str, Any]:
    """Return, for each condition, how similarly the participant and the robot have driven."""
    return {"conditions": _conductor(request).folder.outcomes(name, participant)}


@router.delete("/studies/{name}/sessions/{participant}", dependencies=[PILOT])
def withdraw_participant(request: Request, name: str, participant: str) -> dict[str, Any]:
    """Permanently delete all data of a participant. The status is 409 while the participant's
    session is running."""
    return {"deleted": _conductor(request).withdraw(name, participant)}


@router.get("/session")
def show_session(request: Request) -> dict[str, Any]:
    """Return the current session, or null; a viewer gets only a part of it."""
    conductor = services_of(request).extension(StudyExtension).conductor
    is_viewer = role_of(request) is Role.VIEWER
    return {"session": conductor and (describe_place if is_viewer else describe_session)(conductor)}


@router.post("/session", dependencies=[PILOT], status_code=201)
def begin_session(request: Request, body: NewSession) -> dict[str, Any]:
    """Begin or resume a session, or begin a trial of the paper."""
    conductor = _conductor(request)
    if body.trial is not None:
        conductor.begin_trial(body.trial, body.teach_s or 0)
    else:
        conductor.begin(body.study, body.participant)
    return show_session(request)


@router.delete("/session", dependencies=[PILOT])
def leave_session(request: Request) -> dict[str, Any]:
    """Leave the session; it can be resumed later."""
    _conductor(request).leave()
    return show_session(request)


@router.post("/session/consent", dependencies=[PILOT])
def give_consent(request: Request, body: Consent) -> dict[str, Any]:
    """Record that the participant has consented to the plan's text."""
    _conductor(request).consent(body.language)
    return show_session(request)


@router.post("/session/drive", dependencies=[PILOT])
def drive_condition(request: Request, body: ConditionStart = _RESUME) -> dict[str, Any]:
    """Begin or resume the next condition; 409 if the robot is in the wrong world."""
    _conductor(request).drive(confirmed=body.confirmed, anew=body.anew)
    return show_session(request)


@router.post("/session/answers", dependencies=[PILOT])
def answer_questions(request: Request, body: Answers) -> dict[str, Any]:
    """Save the participant's answers to the questions."""
    _conductor(request).answer(body.answers, is_done=body.done)
    return show_session(request)


class StudyExtension(Extension):
    """Adds studies with participants to a robot's server.

    Attributes:
        conductor: The conductor of sessions; None if nothing is saved.
    """

    routers = (router,)

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        kept = services.persistence
        self.conductor: Conductor | None = None
        if kept is not None:
            self.conductor = Conductor(services.robot, kept, services.hub.broadcast.announce)

    def start(self) -> None:
        if self.conductor is not None:
            self.conductor.start()

    def stop(self) -> None:
        if self.conductor is not None:
            self.conductor.stop()

    def require_free_model(self) -> None:
        """Raise ConfigurationError while a participant's session is running."""
        if self.conductor is not None and self.conductor.session is not None:
            raise ConfigurationError("A participant's session is running; leave the session first.")
