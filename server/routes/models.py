"""`/api/models`: the models on this robot. Documented in docs/reference/http.md."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, Depends, HTTPException, Request, Response

from robot.policy.png import encode_png
from robot.policy.registry import split_name
from robot.store.models.model import decode_model
from robot.store.models.store import StoredModel
from server.routes.bodies import do, read_body, refusals, require_no_session, text_field
from server.security.guard import require_pilot, require_viewer
from server.services import persistence_of

router = APIRouter(prefix="/api/models")
VIEWER, PILOT = Depends(require_viewer), Depends(require_pilot)
NO_SESSION = Depends(require_no_session)


def describe_model(saved: StoredModel) -> dict[str, Any]:
    """Return one model as the page gets it."""
    summary = saved.summary
    return {
        "name": saved.name,
        "current": saved.is_current,
        "bytes": saved.bytes,
        "damaged": list(saved.damaged),
        "readable": summary is not None,
        "place": summary.place if summary else "",
        "saved_at_s": summary.saved_at_s if summary else None,
        "learner": summary.learner if summary else None,
        "moves": [move.value for move in summary.moves] if summary else [],
        "taught": {action.value: n for action, n in summary.taught.items()} if summary else {},
        "lessons": summary.n_examples if summary else 0,
        "nodes": summary.n_nodes if summary else 0,
    }


MOST_NODES = 2048
"""Memory grows with its square: 2048 images take about 50 MB."""


@router.get("", dependencies=[VIEWER])
def list_models(request: Request) -> dict[str, Any]:
    """List all models, the one saved last first."""
    persistence = persistence_of(request)
    with refusals():
        models = [describe_model(saved) for saved in persistence.models.saved()]
    return {"current": persistence.autosave.name, "models": models}


@router.post("", dependencies=[PILOT, NO_SESSION], status_code=201)
async def begin_model(request: Request) -> dict[str, str]:
    """Save the model in use and start an empty one: {name?, learner?, place?}."""
    body = await read_body(request)
    name, learner, place = (text_field(body, field) for field in ("name", "learner", "place"))
    with refusals():
        if learner is not None and split_name(learner)[1] > MOST_NODES:
            raise HTTPException(422, f"A model has at most {MOST_NODES} images, not {learner}.")
    return {"name": await do(persistence_of(request).autosave.begin, name, learner, place)}


@router.post("/save", dependencies=[PILOT])
async def save_model(request: Request) -> dict[str, str]:
    """Save the model in use now."""
    return {"name": await do(persistence_of(request).autosave.save)}


@router.post("/restore", dependencies=[PILOT])
async def restore_model(request: Request) -> dict[str, str]:
    """Restore a deleted model: {undo}, as `delete` returned it."""
    key = text_field(await read_body(request), "undo", "") or ""
    return {"name": await do(persistence_of(request).models.restore, key)}


@router.post("/{name}/load", dependencies=[PILOT, NO_SESSION])
async def load_model(request: Request, name: str) -> dict[str, str]:
    """Save the model in use and load this one; 409 unless the robot is stopped."""
    await do(persistence_of(request).autosave.load, name)
    return {"name": name}


@router.patch("/{name}", dependencies=[PILOT])
async def change_model(request: Request, name: str) -> dict[str, str]:
    """Rename a model, or set the place where it was taught: {name?, place?}."""
    body = await read_body(request)
    new_name, place = text_field(body, "name"), text_field(body, "place")
    persistence = persistence_of(request)
    if place is not None:
        await do(persistence.autosave.set_place, name, place)
    if new_name is not None and new_name != name:
        name = await do(persistence.autosave.rename, name, new_name)
    return {"name": name}


@router.post("/{name}/copy", dependencies=[PILOT], status_code=201)
async def copy_model(request: Request, name: str) -> dict[str, str]:
    """Copy a model: {name?} of the copy."""
    new_name = text_field(await read_body(request), "name")
    return {"name": await do(persistence_of(request).models.copy, name, new_name)}


@router.delete("/{name}", dependencies=[PILOT, NO_SESSION])
async def delete_model(request: Request, name: str) -> dict[str, str]:
    """Move a model to the trash; `undo` is the key that restores it."""
    return {"undo": await do(persistence_of(request).autosave.delete, name)}


@router.get("/{name}/preview", dependencies=[VIEWER])
def preview_model(request: Request, name: str) -> Response:
    """Return the model's most used learned image, as PNG."""
    persistence = persistence_of(request)
    with refusals():
        model = decode_model(persistence.models.read_file(name))
        return Response(encode_png(model.preview), media_type="image/png")


@router.get("/{name}/file", dependencies=[VIEWER])
def download_model(request: Request, name: str) -> Response:
    """Download the model as a file."""
    persistence = persistence_of(request)
    with refusals():
        data = persistence.models.read_file(name)
    disposition = f"attachment; filename*=UTF-8''{quote(name, safe='')}.npz"
    return Response(
        data, media_type="application/zip", headers={"content-disposition": disposition}
    )


@router.put("/{name}/file", dependencies=[PILOT], status_code=201)
async def upload_model(request: Request, name: str) -> dict[str, str]:
    """Save an uploaded model under this name, or under a similar one if it is taken."""
    persistence = persistence_of(request)
    data = await request.body()
    if not data:
        raise HTTPException(400, "The body must be a model's file.")
    return {"name": await do(persistence.models.add_file, name, data)}
