"""`/api/episodes` and `/api/storage`: recordings and their edits. See docs/reference/http.md."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from fastapi import APIRouter, Depends, HTTPException, Request, Response
from starlette.responses import FileResponse

from robot.driver import describe as describe_moves
from robot.errors import ConfigurationError
from robot.policy.image import to_rgb
from robot.policy.png import encode_png
from robot.store.episodes.editing import EpisodeFrame, choose, moments, read_move
from robot.store.episodes.edits import Edit, Notes, trim
from robot.store.episodes.episode import Episode
from robot.store.episodes.summary import EpisodeSummary
from robot.types import Encoding
from server.routes.bodies import do, read_body, refusals, text_field
from server.security.guard import require_pilot, require_viewer
from server.services import persistence_of

router = APIRouter(prefix="/api")
VIEWER, PILOT = Depends(require_viewer), Depends(require_pilot)
_MOST_IN_A_STRIP = 400
_COLUMNS = (
    "frame",
    "at_s",
    "label",
    "predicted",
    "confidence",
    "driven_by",
    "sent",
    "deleted",
    "intervention",
    "asks_pilot",
    "distance_m",
    "bumped",
    "pose",
)


def describe_episode(summary: EpisodeSummary, recording: str | None = None) -> dict[str, Any]:
    """Return one episode as the page gets it."""
    return {
        "id": summary.id,
        "title": summary.title,
        "protected": summary.is_protected,
        "recording": summary.id == recording,
        "bytes": summary.bytes,
        "started_at_s": summary.started_at_s,
        "duration_s": summary.duration_s,
        "frames": summary.frames,
        "taught": dict(summary.taught),
        "lessons": sum(summary.taught.values()),
        "robot": summary.robot,
        "learner": summary.learner,
        "source": summary.source,
        "edits": summary.edits,
        "readable": summary.is_readable,
        "damage": summary.damage,
    }


def describe_frame(moment: EpisodeFrame) -> dict[str, Any]:
    """Return one picture of the strip as the page gets it."""
    return {
        "frame": moment.frame_id,
        "at_s": round(moment.at_s, 3),
        "label": moment.label,
        "relabelled": moment.is_relabelled,
        "deleted": moment.is_deleted,
        "predicted": moment.predicted,
        "confidence": moment.confidence,
        "driven_by": moment.driven_by,
        "sent": moment.sent,
        "intervention": moment.is_intervention,
        "asks_pilot": moment.asks_pilot,
        "distance_m": moment.distance_m,
        "bumped": moment.bumped,
        "pose": moment.pose,
    }


@router.get("/episodes", dependencies=[VIEWER])
def list_episodes(request: Request) -> Response:
    """List all episodes, the newest first."""
    persistence = persistence_of(request)
    recorder = persistence.recorder
    with refusals():
        summaries = persistence.episodes.summaries()
    answer = {
        "recording": recorder.episode_id,
        "fault": recorder.fault,
        "dropped_frames": recorder.dropped_frames,
        "episodes": [describe_episode(summary, recorder.episode_id) for summary in summaries],
    }
    # NOTE: encoded here, because FastAPI takes a second for a list of 2,000.
    return Response(json.dumps(answer, allow_nan=False), media_type="application/json")


@router.get("/storage", dependencies=[VIEWER])
def show_storage(request: Request) -> dict[str, Any]:
    """Return the disk usage, and which episodes could be deleted if it is too much."""
    persistence = persistence_of(request)
    with refusals():
        usage, budget = persistence.storage.usage(), persistence.episodes.budget()
    return {
        **dataclasses.asdict(usage),
        "budget": budget.budget_bytes,
        "offered": [describe_episode(summary) for summary in budget.offered],
    }


@router.post("/episodes/restore", dependencies=[PILOT])
async def restore_episode(request: Request) -> dict[str, str]:
    """Restore a deleted episode: {undo}, as `delete` returned it."""
    key = text_field(await read_body(request), "undo", "") or ""
    return {"id": await do(persistence_of(request).episodes.restore, key)}


@router.get("/episodes/{episode_id}", dependencies=[VIEWER])
def show_episode(request: Request, episode_id: str) -> dict[str, Any]:
    """Describe one episode, with its edits and the run's metadata."""
    persistence = persistence_of(request)
    with refusals():
        episode, notes = (
            persistence.episodes.open(episode_id),
            persistence.episodes.notes(episode_id),
        )
        summary = persistence.episodes.summary(episode_id)
    ids = list(episode.frames)
    return {
        **describe_episode(summary, persistence.recorder.episode_id),
        "run": episode.run,
        "moves": [move.value for move in episode.moves],
        "declared_moves": [
            move.describe() for move in describe_moves(episode.moves, episode.declared_moves)
        ],
        "first_frame": ids[0] if ids else None,
        "last_frame": ids[-1] if ids else None,
        "edit_list": _describe_edits(notes),
        "redoable": len(notes.undone),
    }


@router.get("/episodes/{episode_id}/strip", dependencies=[VIEWER])
def show_strip(
    request: Request,
    episode_id: str,
    count: int = 24,
    first: int | None = None,
    last: int | None = None,
) -> dict[str, Any]:
    """Return evenly spaced pictures, each with label, prediction and driver."""
    persistence = persistence_of(request)
    with refusals():
        episode, notes = (
            persistence.episodes.open(episode_id),
            persistence.episodes.notes(episode_id),
        )
    found = [
        moment
        for moment in moments(episode, notes)
        if (first is None or moment.frame_id >= first) and (last is None or moment.frame_id <= last)
    ]
    chosen = choose(found, min(max(count, 1), _MOST_IN_A_STRIP))
    return {"frames": [describe_frame(moment) for moment in chosen], "of": len(found)}


@router.get("/episodes/{episode_id}/timeline", dependencies=[VIEWER])
def show_timeline(request: Request, episode_id: str) -> dict[str, Any]:
    """Return every picture's label, prediction and driver, as columns for drawing."""
    persistence = persistence_of(request)
    with refusals():
        episode, notes = (
            persistence.episodes.open(episode_id),
            persistence.episodes.notes(episode_id),
        )
    found = moments(episode, notes)
    rows = [describe_frame(moment) for moment in found]
    return {
        "columns": {name: [row[name] for row in rows] for name in _COLUMNS},
        "is_estimate": any(moment.is_pose_estimate for moment in found),
    }


@router.get("/episodes/{episode_id}/frames/{frame_id}", dependencies=[VIEWER])
def show_frame(request: Request, episode_id: str, frame_id: int) -> Response:
    """Return one picture: JPEG as recorded, or PNG."""
    persistence = persistence_of(request)
    with refusals():
        frame = persistence.episodes.open(episode_id).frame(frame_id)
        if frame.encoding is Encoding.JPEG:
            return _picture(frame.data, "image/jpeg")
        return _picture(encode_png(to_rgb(frame), level=1), "image/png")


def _picture(data: bytes, kind: str) -> Response:
    headers = {"cache-control": "private, max-age=3600"}
    return Response(data, media_type=kind, headers=headers)


@router.get("/episodes/{episode_id}/file", dependencies=[VIEWER])
def download_episode(request: Request, episode_id: str) -> Response:
    """Download the recording without its edits."""
    with refusals():
        path = persistence_of(request).episodes.path(episode_id)
    return FileResponse(path, media_type="application/octet-stream", filename=path.name)


@router.patch("/episodes/{episode_id}", dependencies=[PILOT])
async def change_episode(request: Request, episode_id: str) -> dict[str, Any]:
    """Set the title of an episode, or protect it: {title?, protected?}."""
    body = await read_body(request)
    title, protected = text_field(body, "title"), body.get("protected")
    if protected is not None and not isinstance(protected, bool):
        raise HTTPException(400, "'protected' must be true or false.")
    store = persistence_of(request).episodes
    if title is not None:
        await do(store.set_title, episode_id, title)
    if protected is not None:
        await do(store.protect, episode_id, protected)
    return describe_episode(await do(store.summary, episode_id))


@router.post("/episodes/{episode_id}/edits", dependencies=[PILOT], status_code=201)
async def edit_episode(request: Request, episode_id: str) -> dict[str, Any]:
    """Edit: {verb: delete | trim | relabel, first, last, label?}; frames, both ends included."""
    body = await read_body(request)
    store = persistence_of(request).episodes

    def edit() -> Notes:
        return store.edit(episode_id, _read_edit(body, store.open(episode_id)))

    return {"edit_list": _describe_edits(await do(edit))}


@router.delete("/episodes/{episode_id}/edits/last", dependencies=[PILOT])
async def undo_edit(request: Request, episode_id: str) -> dict[str, Any]:
    """Undo the last edit."""
    notes = await do(persistence_of(request).episodes.undo_edit, episode_id)
    return {"edit_list": _describe_edits(notes)}


@router.post("/episodes/{episode_id}/edits/redo", dependencies=[PILOT])
async def redo_edit(request: Request, episode_id: str) -> dict[str, Any]:
    """Redo the edit that was undone last."""
    notes = await do(persistence_of(request).episodes.redo_edit, episode_id)
    return {"edit_list": _describe_edits(notes)}


@router.post("/episodes/{episode_id}/split", dependencies=[PILOT], status_code=201)
async def split_episode(request: Request, episode_id: str) -> dict[str, str]:
    """Split a recording in two: {frame} is the first of the second part."""
    frame = (await read_body(request)).get("frame")
    if not isinstance(frame, int) or isinstance(frame, bool):
        raise HTTPException(400, "'frame' must be a frame's number.")
    return {"id": await do(persistence_of(request).episodes.split, episode_id, frame)}


@router.post("/episodes/{episode_id}/compact", dependencies=[PILOT])
async def compact_episode(request: Request, episode_id: str) -> dict[str, str]:
    """Apply the edits to the recording; `undo` restores the original."""
    return {"undo": await do(persistence_of(request).episodes.compact, episode_id)}


@router.delete("/episodes/{episode_id}", dependencies=[PILOT])
async def delete_episode(request: Request, episode_id: str) -> dict[str, str]:
    """Move an episode to the trash; `undo` is the key that restores it."""
    return {"undo": await do(persistence_of(request).episodes.delete, episode_id)}


def _read_edit(body: dict[str, Any], episode: Episode) -> Edit:
    verb, first, last = body.get("verb"), body.get("first"), body.get("last")
    for value in (first, last):
        if not isinstance(value, int) or isinstance(value, bool):
            raise ConfigurationError("'first' and 'last' must be frame ids")
    assert isinstance(first, int) and isinstance(last, int)
    if verb == "trim":
        return trim(list(episode.frames), first, last)
    label = read_move(body.get("label"), episode) if verb == "relabel" else None
    return Edit(verb=str(verb), ranges=((first, last),), label=label)


def _describe_edits(notes: Notes) -> list[dict[str, Any]]:
    return [
        {"verb": e.verb, "ranges": [list(r) for r in e.ranges], "label": e.label}
        for e in notes.edits
    ]
