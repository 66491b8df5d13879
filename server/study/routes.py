"""`/api/studies` and `/api/session`: studies with participants. See docs/reference/http.md."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fastapi import APIRouter, Depends, HTTPException, Request, Response

from robot.study.builtin import TRIALS, paper_plan
from server.routes.bodies import do, read_body, text_field
from server.security.access import Role
from server.security.guard import require_pilot, require_viewer, role_of
from server.services import persistence_of, services_of
from server.study.conductor import Conductor
from server.study.described import describe_place, describe_session, describe_study
from server.study.older import list_results, read_result

if TYPE_CHECKING:
    from server.study.extension import StudyExtension

router = APIRouter(prefix="/api")
VIEWER, PILOT = Depends(require_viewer), Depends(require_pilot)


def _extension(request: Request) -> StudyExtension:
    from server.study.extension import StudyExtension  # which has these routes

    return services_of(request).extension(StudyExtension)


def _conductor(request: Request) -> Conductor:
    persistence_of(request)  # 503 where nothing is saved
    conductor = _extension(request).conductor
    assert conductor is not None
    return conductor


def _older(request: Request) -> Path:
    return persistence_of(request).storage.root / "lessons"


@router.get("/studies", dependencies=[PILOT])
async def list_studies(request: Request) -> dict[str, Any]:
    """List the studies' names, and results of guided trials that 0.2 kept."""
    names = await do(_conductor(request).folder.names)
    return {"studies": names, "older": await do(list_results, _older(request))}


@router.get("/studies/older/{result_id}.json", dependencies=[PILOT])
async def download_older(request: Request, result_id: str) -> Response:
    """Return the result of one guided trial of 0.2 as a file."""
    data = await do(read_result, _older(request), result_id)
    return _file(data, "application/json", f"{result_id}.json")


@router.post("/studies", dependencies=[PILOT], status_code=201)
async def create_study(request: Request) -> dict[str, str]:
    """Make a study of a plan: {name, plan}, a TOML text, or {name, trial} for the paper's."""
    body = await read_body(request)
    name = text_field(body, "name", "") or ""
    plan, trial = body.get("plan"), body.get("trial")
    if isinstance(trial, int) and trial in TRIALS and plan is None:
        plan = paper_plan(trial)
    if not isinstance(plan, str):
        raise HTTPException(400, "Send 'plan', a TOML text, or 'trial', 1, 2 or 3.")
    try:
        plan.encode()
    except UnicodeEncodeError as error:
        raise HTTPException(400, "'plan' must be valid Unicode text.") from error
    return {"name": await do(_conductor(request).folder.create, name, plan)}


@router.get("/studies/{name}", dependencies=[PILOT])
async def show_study(request: Request, name: str) -> dict[str, Any]:
    """Return a study, its sessions, and the order that the next participant gets."""
    found: dict[str, Any] = await do(describe_study, _conductor(request).folder, name)
    return found


@router.get("/studies/{name}/zip", dependencies=[PILOT])
async def download_study(request: Request, name: str) -> Response:
    """Return everything of a study: plan, event logs, tables, figures."""
    data = await do(_conductor(request).folder.zip, name)
    return _file(data, "application/zip", f"{name}.zip")


def _file(data: bytes, media_type: str, name: str) -> Response:
    headers = {"content-disposition": f"attachment; filename*=UTF-8''{quote(name)}"}
    return Response(data, media_type=media_type, headers=headers)


@router.get("/studies/{name}/sessions/{participant}", dependencies=[PILOT])
async def show_outcomes(request: Request, name: str, participant: str) -> dict[str, Any]:
    """Return how alike participant and robot drove, by condition."""
    return {"conditions": await do(_conductor(request).folder.outcomes, name, participant)}


@router.delete("/studies/{name}/sessions/{participant}", dependencies=[PILOT])
async def withdraw_participant(request: Request, name: str, participant: str) -> dict[str, Any]:
    """Delete all that is kept of a participant for good; 409 while that session is on."""
    conductor = _conductor(request)
    return {"deleted": await do(conductor.withdraw, name, participant)}


@router.get("/session", dependencies=[VIEWER])
def show_session(request: Request) -> dict[str, Any]:
    """Return the session that is on, or null; a viewer gets where it stands, and no more."""
    conductor = _extension(request).conductor
    is_viewer = role_of(request) is Role.VIEWER
    return {"session": conductor and (describe_place if is_viewer else describe_session)(conductor)}


@router.post("/session", dependencies=[PILOT], status_code=201)
async def begin_session(request: Request) -> dict[str, Any]:
    """Begin a session, or take it up again: {study, participant}, or a trial: {trial, teach_s}."""
    body, conductor = await read_body(request), _conductor(request)
    if "trial" in body:
        await do(conductor.begin_trial, body["trial"], body.get("teach_s"))
    else:
        study, code = (text_field(body, name, "") or "" for name in ("study", "participant"))
        await do(conductor.begin, study, code)
    return show_session(request)


@router.delete("/session", dependencies=[PILOT])
async def leave_session(request: Request) -> dict[str, Any]:
    """Leave the session; it can be taken up again where it is."""
    await do(_conductor(request).leave)
    return show_session(request)


@router.post("/session/consent", dependencies=[PILOT])
async def give_consent(request: Request) -> dict[str, Any]:
    """Note that the participant confirmed the plan's text: {language}."""
    language = text_field(await read_body(request), "language", "") or ""
    await do(_conductor(request).consent, language)
    return show_session(request)


@router.post("/session/drive", dependencies=[PILOT])
async def drive_condition(request: Request) -> dict[str, Any]:
    """Begin the next condition, or go on: {confirmed?, anew?}; 409 in the wrong world."""
    body, conductor = await read_body(request), _conductor(request)
    confirmed, anew = body.get("confirmed") is True, body.get("anew") is True
    await do(lambda: conductor.drive(confirmed=confirmed, anew=anew))
    return show_session(request)


@router.post("/session/answers", dependencies=[PILOT])
async def answer_questions(request: Request) -> dict[str, Any]:
    """Take answers, {answers: {question: answer}, done?}; with `done` all must be there."""
    body, conductor = await read_body(request), _conductor(request)
    answers = body.get("answers", {})
    if not isinstance(answers, dict):
        raise HTTPException(400, "'answers' must be an object of answers by question.")
    await do(lambda: conductor.answer(answers, is_done=body.get("done") is True))
    return show_session(request)
