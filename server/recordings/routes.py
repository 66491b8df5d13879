"""`/api/episodes`: recordings and their edits. See docs/reference/http.md."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from urllib.parse import quote

from fastapi import APIRouter, Depends, Query, Request, Response
from starlette.concurrency import iterate_in_threadpool
from starlette.responses import FileResponse, StreamingResponse

from robot.devices.encoders import encode_png
from robot.devices.raw_value import RawValue, must_be, text
from robot.errors import NotFoundError
from robot.moves import describe as describe_moves
from robot.policy.image import to_rgb
from robot.recordings.archive import join_recording, zip_recordings
from robot.recordings.editing import edit_of, sample
from robot.recordings.edits import Notes
from robot.recordings.parts import part_paths
from robot.recordings.reading import reading
from robot.recordings.store import Deleted, EpisodeStore
from robot.recordings.summary import EpisodeSummary
from robot.recordings.trash import TRASH_DAYS
from robot.types import Encoding
from server.recordings.extension import episodes_of
from server.recordings.part import Recordings
from server.recordings.separate_process import SeparateWork
from server.routes.answers import Route, answer, media
from server.routes.bodies import Key
from server.services import persistence_of

router = APIRouter(prefix="/api", route_class=Route)
_COLUMNS = {
    "frame": "frame_id",
    "relabelled": "is_relabelled",
    "deleted": "is_deleted",
    "intervention": "is_intervention",
    **{name: name for name in ("at_s", "label", "predicted", "confidence", "driven_by", "sent")},
    **{name: name for name in ("asks_pilot", "distance_m", "bumped", "pose")},
}
"""The attribute of `EpisodeFrame` that each column of a timeline shows."""


class EpisodeChange(RawValue):
    """A request's body: a new title, or protection from deletion, or both."""

    title: str | None = text(None)
    protected: bool | None = must_be("true or false", None)


class EpisodeEdit(RawValue):
    """A request's body: an edit of the frames from `first` to `last`, both included."""

    verb: Literal["delete", "trim", "relabel"] = must_be("delete, trim or relabel")
    first: int = must_be("a frame's number")
    last: int = must_be("a frame's number")
    label: str | None = text(None)


class EpisodeChoice(RawValue):
    """A request's body: several episodes."""

    episodes: list[str] = must_be("a list of episodes' ids")


class EpisodeSplit(RawValue):
    """A request's body: the first frame of the second part."""

    frame: int = must_be("a frame's number")


@dataclass
class EpisodeAnswer:
    """One episode as the page gets it."""

    recording: bool
    id: str
    title: str
    protected: bool
    bytes: int
    started_at_s: float
    duration_s: float
    frames: int
    taught: dict[str, int]
    lessons: int
    robot: str
    learner: str
    source: str
    edits: int
    readable: bool
    damage: str | None


@dataclass
class EpisodeList:
    """All episodes, the newest first, and the state of the recording.

    `offered` are the episodes that the page suggests for deletion if the disk gets full. `undo` is
    the key that restores the episodes deleted last. `trash_bytes` is the size of the trash, from
    which episodes are removed after `days`.
    """

    recording: str | None
    fault: str | None
    dropped_frames: int
    episodes: list[EpisodeAnswer]
    offered: list[str]
    trash_bytes: int
    undo: str | None
    days: int


@dataclass
class DeletedEpisodes:
    """The result of a deletion: the deleted episodes, and by id the reasons why others were kept.

    `undo` is the key that restores all deleted episodes at once. The key `undo` can be used for
    `days` days.
    """

    undo: str | None
    deleted: list[str]
    kept: dict[str, str]
    days: int


@dataclass
class RestoredEpisodes:
    """The ids of the restored episodes; `id` is the first."""

    id: str
    ids: list[str]


@dataclass
class EditAnswer:
    """One edit of an episode: its verb, its ranges of frames, and its label."""

    verb: str
    ranges: Sequence[Sequence[int]]
    label: str | None


Edits = dict[str, list[EditAnswer]]
"""The edits of an episode."""


@dataclass
class EpisodeDetails(EpisodeAnswer):
    """One episode with its edits and the metadata of its run."""

    run: dict[str, Any]
    moves: list[str]
    declared_moves: list[dict[str, Any]]
    first_frame: int | None
    last_frame: int | None
    results: list[dict[str, Any]]
    edit_list: Sequence[EditAnswer]
    redoable: int


@dataclass
class EpisodeTimeline:
    """The pictures of an episode; each of `_COLUMNS` is a list with a value for each picture."""

    columns: dict[str, list[Any]]
    is_estimate: bool


async def _store_of(request: Request) -> EpisodeStore:
    return episodes_of(request)


STORE: Any = Depends(_store_of)
CHOSEN: Any = Query([])


def _describe(summary: EpisodeSummary, recording: str | None = None) -> EpisodeAnswer:
    return answer(
        EpisodeAnswer,
        summary,
        recording=summary.id == recording,
        protected=summary.is_protected,
        lessons=sum(summary.taught.values()),
        readable=summary.is_readable,
    )


@router.get("/episodes", responses={200: {"model": EpisodeList}})
def list_episodes(request: Request) -> Response:
    """List all episodes, the newest first."""
    part = persistence_of(request).part(Recordings)
    recording = part.recorder.recording
    found = EpisodeList(
        recording=recording.episode_id,
        fault=recording.fault,
        dropped_frames=recording.lost["frames"],
        episodes=[_describe(one, recording.episode_id) for one in part.episodes.summaries()],
        offered=[one.id for one in part.episodes.offered()],
        trash_bytes=persistence_of(request).storage.trash_bytes(),
        undo=max(part.episodes.trash(), default=None),
        days=TRASH_DAYS,
    )
    # NOTE: The list is encoded here, because FastAPI would need a second for 2,000 episodes.
    return Response(json.dumps(found, default=vars, allow_nan=False), media_type="application/json")


@router.post("/episodes/restore")
def restore_episodes(body: Key, store: EpisodeStore = STORE) -> RestoredEpisodes:
    """Restore the episodes that a deletion has moved to the trash; the request's body contains the
    key that the deletion returned."""
    ids = store.restore(body.undo)
    return RestoredEpisodes(id=ids[0], ids=ids)


@router.post("/episodes/delete")
def delete_episodes(body: EpisodeChoice, store: EpisodeStore = STORE) -> DeletedEpisodes:
    """Move several episodes to the trash together, except those that cannot be deleted now."""
    return _deleted(store.delete(*body.episodes))


@router.get("/episodes.zip", **media("application/zip"))
def download_episodes(episode: list[str] = CHOSEN, store: EpisodeStore = STORE) -> Response:
    """Download several recordings, or all, with their edits, as one zip file."""
    paths = [store.path(one) for one in dict.fromkeys(episode or store.ids())]
    if not paths:
        raise NotFoundError("nothing is recorded yet")
    headers = {"content-disposition": 'attachment; filename="recordings.zip"'}
    zipped = _sent(paths, zip_recordings(paths))
    return StreamingResponse(zipped, media_type="application/zip", headers=headers)


async def _sent(paths: Sequence[Path], blocks: Iterator[bytes]) -> AsyncIterator[bytes]:
    """Yield the blocks of a download, which are read on other threads.

    The recordings at `paths` cannot be deleted until everything is sent or the client has left.
    """
    with reading(paths):
        async for block in iterate_in_threadpool(blocks):
            yield block


async def _sent_separately(path: Path) -> AsyncIterator[bytes]:
    """Yield a recording as one file; a separate process joins its files."""
    with reading([path]), contextlib.closing(SeparateWork(join_recording, path)) as blocks:
        # Use asyncio's own threads: the server's shutdown would wait for a thread of anyio's pool.
        loop = asyncio.get_running_loop()
        while block := await loop.run_in_executor(None, next, blocks, b""):
            yield block


@router.delete("/trash")
def empty_trash(request: Request) -> dict[str, int]:
    """Permanently delete the episodes in the trash."""
    return {"freed_bytes": persistence_of(request).storage.empty_trash()}


@router.get("/episodes/{episode_id}")
def show_episode(request: Request, episode_id: str, store: EpisodeStore = STORE) -> EpisodeDetails:
    """Describe one episode, with its edits and the metadata of its run."""
    episode, notes = store.open(episode_id), store.notes(episode_id)
    ids = episode.frames.ids[[0, -1]].tolist() if len(episode.frames) else []
    declared = describe_moves(episode.moves, episode.declared_moves)
    return answer(
        EpisodeDetails,
        _describe(store.summary(episode_id), persistence_of(request).run),
        run=episode.run,
        moves=[move.value for move in episode.moves],
        declared_moves=[move.describe() for move in declared],
        first_frame=ids[0] if ids else None,
        last_frame=ids[-1] if ids else None,
        results=episode.results,
        **_edits(notes),
        redoable=len(notes.undone),
    )


@router.get("/episodes/{episode_id}/timeline")
def show_timeline(
    episode_id: str,
    count: int | None = None,
    first: int | None = None,
    last: int | None = None,
    store: EpisodeStore = STORE,
) -> EpisodeTimeline:
    """Return the data of each picture, such as its label and prediction. With `count`, return at
    most `count` evenly spaced pictures.

    `first` and `last` restrict the answer to the pictures in this range.
    """
    episode, notes = store.open(episode_id), store.notes(episode_id)
    between = None if first is None or last is None else (first, last)
    total = len(episode.frames) if count is None else max(count, 1)
    shown = sample(episode, notes, total, between)
    columns = {name: [getattr(one, of) for one in shown] for name, of in _COLUMNS.items()}
    columns["at_s"] = [round(one.at_s, 3) for one in shown]
    is_estimate = any(moment.is_pose_estimate for moment in shown)
    return EpisodeTimeline(columns=columns, is_estimate=is_estimate)


@router.get("/episodes/{episode_id}/frames/{frame_id}", **media("image/jpeg", "image/png"))
def show_frame(episode_id: str, frame_id: int, store: EpisodeStore = STORE) -> Response:
    """Return one picture: JPEG as recorded, or PNG."""
    frame = store.open(episode_id).frame(frame_id)
    is_jpeg = frame.encoding is Encoding.JPEG
    return Response(
        frame.data if is_jpeg else encode_png(to_rgb(frame), level=1),
        media_type="image/jpeg" if is_jpeg else "image/png",
        headers={"cache-control": "private, max-age=3600"},
    )


@router.get("/episodes/{episode_id}/file", **media("application/octet-stream"))
def download_episode(episode_id: str, store: EpisodeStore = STORE) -> Response:
    """Download the recording without its edits."""
    path, kind = store.path(episode_id), "application/octet-stream"
    if len(part_paths(path)) == 1:
        return FileResponse(path, media_type=kind, filename=path.name)
    headers = {"content-disposition": f"attachment; filename*=utf-8''{quote(path.name)}"}
    joined = _sent_separately(path)
    return StreamingResponse(joined, media_type=kind, headers=headers)


@router.patch("/episodes/{episode_id}")
def change_episode(
    episode_id: str, body: EpisodeChange, store: EpisodeStore = STORE
) -> EpisodeAnswer:
    """Set the title of an episode, or protect it."""
    if body.title is not None:
        store.set_title(episode_id, body.title)
    if body.protected is not None:
        store.protect(episode_id, body.protected)
    return _describe(store.summary(episode_id))


@router.post("/episodes/{episode_id}/edits", status_code=201)
def edit_episode(episode_id: str, body: EpisodeEdit, store: EpisodeStore = STORE) -> Edits:
    """Delete or relabel the frames from `first` to `last`, or delete all others (`trim`)."""
    between = (body.first, body.last)
    edit = edit_of(body.verb, between, store.open(episode_id), body.label)
    return _edits(store.edit(episode_id, edit))


@router.delete("/episodes/{episode_id}/edits/last")
def undo_edit(episode_id: str, store: EpisodeStore = STORE) -> Edits:
    """Undo the last edit."""
    return _edits(store.undo_edit(episode_id))


@router.post("/episodes/{episode_id}/edits/redo")
def redo_edit(episode_id: str, store: EpisodeStore = STORE) -> Edits:
    """Redo the edit that was undone last."""
    return _edits(store.redo_edit(episode_id))


@router.post("/episodes/{episode_id}/split", status_code=201)
def split_episode(
    episode_id: str, body: EpisodeSplit, store: EpisodeStore = STORE
) -> dict[str, str]:
    """Split a recording in two."""
    return {"id": store.split(episode_id, body.frame)}


@router.post("/episodes/{episode_id}/compact")
def compact_episode(episode_id: str, store: EpisodeStore = STORE) -> dict[str, str]:
    """Apply the edits to the recording itself; `undo` is the key that restores the original."""
    return {"undo": store.compact(episode_id)}


@router.delete("/episodes/{episode_id}")
def delete_episode(episode_id: str, store: EpisodeStore = STORE) -> DeletedEpisodes:
    """Move an episode to the trash; `undo` is the key that restores it."""
    return _deleted(store.delete(episode_id))


def _deleted(gone: Deleted) -> DeletedEpisodes:
    return DeletedEpisodes(
        undo=gone.key, deleted=list(gone.ids), kept=dict(gone.kept), days=TRASH_DAYS
    )


def _edits(notes: Notes) -> Edits:
    return {"edit_list": [answer(EditAnswer, edit) for edit in notes.edits]}
