"""`/api/lesson`: the paper's study with a person. See docs/reference/http.md."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastapi import APIRouter, Depends, HTTPException, Request, Response
from starlette.concurrency import run_in_threadpool

from robot.lab.protocol import TRIALS
from robot.types import Mode
from server.routes.bodies import do, read_body, refusals, require_no_session
from server.security.guard import require_pilot, require_viewer
from server.services import persistence_of, services_of
from server.study.described import describe_drive
from server.study.lesson import Study, TrialModels, check_world, list_results, read_result

if TYPE_CHECKING:
    from server.study.extension import StudyExtension

router = APIRouter(prefix="/api/lesson")
VIEWER, PILOT = Depends(require_viewer), Depends(require_pilot)


def _extension(request: Request) -> StudyExtension:
    from server.study.extension import StudyExtension  # which has these routes

    return services_of(request).extension(StudyExtension)


def _study(request: Request) -> Study:
    return _extension(request).study


def _folder(request: Request) -> Path:
    return persistence_of(request).storage.root / "lessons"


@router.get("", dependencies=[VIEWER])
def describe_lesson(request: Request) -> dict[str, Any]:
    """Return the study run in progress, or null."""
    lesson = _study(request).describe() or describe_drive(_extension(request).conductor)
    return {"lesson": lesson}


@router.post("", dependencies=[PILOT, Depends(require_no_session)], status_code=201)
async def begin_lesson(request: Request) -> dict[str, Any]:
    """Start a study run with an empty model: {trial, teach_s}; 409 unless the robot is stopped."""
    body = await read_body(request)
    trial, teach_s = _whole(body, "trial"), _whole(body, "teach_s")
    study, persistence = _study(request), persistence_of(request)
    if trial not in TRIALS:
        raise HTTPException(400, "'trial' must be 1, 2 or 3.")
    moves = TRIALS[trial][1]
    robot = services_of(request).robot
    if not set(moves) <= set(robot.driver.moves):
        raise HTTPException(409, f"This robot cannot {', '.join(moves)}.")
    with refusals():
        check_world(robot.driver, trial)
    await _leave(request)
    autosave, before = persistence.autosave, robot.loop.state
    with refusals():
        is_worth_it = autosave.name is not None or any(before.taught.values())
        known = await run_in_threadpool(autosave.save) if is_worth_it else None
        name = await run_in_threadpool(autosave.begin, f"Trial {trial}", None, None, moves)
        study.begin(trial, teach_s)
    study.models = TrialModels(own=name, before=known, moves_before=before.moves)
    return {"lesson": study.describe()}


@router.delete("", dependencies=[PILOT])
async def abandon_lesson(request: Request) -> dict[str, Any]:
    """End the trial. If it is not finished, the model in use before it is loaded again."""
    await _leave(request)
    return {"lesson": None}


async def _leave(request: Request) -> None:
    study, services = _study(request), services_of(request)
    models = study.abandon()
    if models is None:
        return
    loop, autosave = services.robot.loop, persistence_of(request).autosave

    def restore() -> None:
        if autosave.name == models.own:
            if models.before is not None:
                autosave.load(models.before)
            else:
                autosave.delete(autosave.begin(None, None, None, models.moves_before))
        if models.own in autosave.store.names():
            autosave.delete(models.own)

    await asyncio.wrap_future(loop.set_mode(Mode.STOPPED))
    await do(restore)


@router.post("/answer", dependencies=[PILOT])
async def answer_question(request: Request) -> dict[str, Any]:
    """Answer the closing question, {answer: 1 to 7}, and save the result."""
    answer = _whole(await read_body(request), "answer")
    with refusals():
        return await run_in_threadpool(_study(request).judge, answer, _folder(request))


@router.get("/results", dependencies=[VIEWER])
def results(request: Request) -> dict[str, Any]:
    """List the saved results, the newest first."""
    return {"results": list_results(_folder(request))}


@router.get("/results/{result_id}.json", dependencies=[VIEWER])
def download_result(request: Request, result_id: str) -> Response:
    """Return one result as a file."""
    with refusals():
        data = read_result(_folder(request), result_id)
    headers = {"content-disposition": f'attachment; filename="{result_id}.json"'}
    return Response(data, media_type="application/json", headers=headers)


def _whole(body: dict[str, Any], name: str) -> int:
    value = body.get(name)
    if not isinstance(value, int) or isinstance(value, bool):
        raise HTTPException(400, f"{name!r} must be a whole number.")
    return value
