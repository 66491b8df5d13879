"""`/api/models`: the list of models, their names, copies and files. See docs/reference/http.md."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from fastapi import APIRouter, HTTPException, Request, Response

from robot.devices.raw_value import must_be, text
from robot.errors import RobotError
from server.library.models import ModelLibrary, StoredModel
from server.routes.answers import PNG, Route, answer, attachment, media, png
from server.routes.bodies import FREE_MODEL, NAMED, Key, Named, do
from server.services import Extension, persistence_of

router = APIRouter(prefix="/api/models", route_class=Route)


class ModelChange(Named):
    """A request's body: a new name for a model, or the place where it was taught, or both."""

    place: str | None = text(None)


class NewModel(ModelChange):
    """A request's body: a new model's name and learner. If `like` names earlier models, the new
    model begins with their weights."""

    learner: str | None = text(None)
    like: list[str] = must_be("a list of models' names", [])


_NEW = NewModel()
_UNREADABLE: Any = SimpleNamespace(
    place="", saved_at_s=None, learner=None, moves=(), taught={}, n_examples=0, n_nodes=0
)
"""The list shows this instead of a model's details if the model cannot be read."""


@dataclass
class ModelAnswer:
    """One model as the page gets it."""

    name: str
    current: bool
    bytes: int
    damaged: Sequence[str]
    readable: bool
    place: str
    saved_at_s: float | None
    learner: str | None
    moves: Sequence[str]
    taught: Mapping[str, int]
    lessons: int
    nodes: int


@dataclass
class ModelList:
    """All models, the newest first, and the name of the model in use."""

    current: str | None
    models: list[ModelAnswer]


@router.get("")
def list_models(request: Request) -> ModelList:
    """List all models, the newest first."""
    models = [_describe(saved) for saved in library_of(request).saved()]
    return ModelList(current=persistence_of(request).autosave.name, models=models)


@router.post("", dependencies=[FREE_MODEL], status_code=201)
def begin_model(request: Request, body: NewModel = _NEW) -> dict[str, str | bool]:
    """Save the model in use and start a new model, which is empty or begins with the weights of
    earlier models."""
    begin, like = persistence_of(request).autosave.begin, library_of(request).begin_like
    name = begin(
        body.name, body.learner, body.place, prepare=lambda policy: like(policy, body.like)
    )
    return _in_use(request, name)


@router.post("/save")
def save_model(request: Request) -> dict[str, str]:
    """Save the model in use now."""
    return {"name": persistence_of(request).autosave.save()}


@router.post("/restore")
def restore_model(request: Request, body: Key) -> dict[str, str]:
    """Restore a deleted model."""
    return {"name": library_of(request).restore(body.undo)}


@router.post("/{name}/load", dependencies=[FREE_MODEL])
def load_model(request: Request, name: str) -> dict[str, str | bool]:
    """Save the model in use and load another; 409 unless the robot is stopped."""
    persistence_of(request).autosave.load(name)
    return _in_use(request, name)


@router.patch("/{name}")
def change_model(request: Request, name: str, body: ModelChange) -> dict[str, str]:
    """Rename a model, set the place where it was taught, or both; an error changes neither."""
    library = library_of(request)
    persistence_of(request).models.require(name)
    renamed = name if body.name is None or body.name == name else library.rename(name, body.name)
    if body.place is not None:
        try:
            library.set_place(renamed, body.place)
        except (OSError, RobotError):
            if renamed != name:
                with contextlib.suppress(OSError, RobotError):
                    library.rename(renamed, name)
            raise
    return {"name": renamed}


@router.post("/{name}/copy", status_code=201)
def copy_model(request: Request, name: str, body: Named = NAMED) -> dict[str, str]:
    """Copy a model; the request's body may name the copy."""
    return {"name": library_of(request).copy(name, body.name)}


@router.delete("/{name}", dependencies=[FREE_MODEL])
def delete_model(request: Request, name: str) -> dict[str, str]:
    """Move a model to the trash; `undo` is the key that restores it."""
    return {"undo": persistence_of(request).autosave.delete(name)}


@router.get("/{name}/preview", **PNG)
def preview_model(request: Request, name: str) -> Response:
    """Return a PNG picture of the learned image into which the most frames were merged."""
    return png(library_of(request).preview(name))


@router.get("/{name}/file", **media("application/zip"))
def download_model(request: Request, name: str) -> Response:
    """Download the model as a file."""
    data = persistence_of(request).models.read_file(name)
    return attachment(data, "application/zip", f"{name}.npz")


@router.put(
    "/{name}/file",
    status_code=201,
    openapi_extra={"requestBody": {"required": True, "content": {"application/octet-stream": {}}}},
)
async def upload_model(request: Request, name: str) -> dict[str, str]:
    """Save an uploaded model under this name, or under a similar name if it is taken."""
    persistence = persistence_of(request)
    data = await request.body()
    if not data:
        raise HTTPException(400, "The request body must be the file of a model.")
    return {"name": await do(persistence.models.add_file, name, data)}


def library_of(request: Request) -> ModelLibrary:
    """Return the library of the robot that this request was sent to; 503 if it saves nothing."""
    kept = persistence_of(request)
    return ModelLibrary(kept.storage, kept.models, kept.autosave)


def _in_use(request: Request, name: str) -> dict[str, str | bool]:
    """Return the model now in use; `kept` is false if the next start would use another one."""
    return {"name": name, "kept": persistence_of(request).models.current == name}


def _describe(saved: StoredModel) -> ModelAnswer:
    known = saved.summary or _UNREADABLE
    return answer(
        ModelAnswer,
        known,
        name=saved.name,
        current=saved.is_current,
        bytes=saved.bytes,
        damaged=saved.damaged,
        readable=saved.summary is not None,
        lessons=known.n_examples,
        nodes=known.n_nodes,
    )


class LibraryExtension(Extension):
    """Adds the routes of models to a robot's server; the core itself saves and loads models."""

    routers = (router,)
