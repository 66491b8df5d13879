"""`/api/gallery`: the learned images. See docs/reference/http.md."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Depends, HTTPException, Request, Response

from robot.policy.gallery import LearnedImage
from robot.policy.png import encode_png
from server.progress import Progress
from server.routes.bodies import read_body
from server.security.guard import require_pilot, require_viewer
from server.services import services_of

router = APIRouter(prefix="/api/gallery")
VIEWER, PILOT = Depends(require_viewer), Depends(require_pilot)


@router.get("", dependencies=[VIEWER])
async def list_images(request: Request) -> dict[str, Any]:
    """List the learned images, in the learner's own order."""
    progress = services_of(request).progress
    state = services_of(request).robot.loop.state
    images = await progress.gallery()
    return {
        "moves": [move.value for move in state.moves],
        # A learner of several places has `max_nodes` images for each of them.
        "max_nodes": max(state.max_nodes, len(images)),
        "images": [_describe(image, progress) for image in images],
    }


@router.get("/{node}.png", dependencies=[VIEWER])
async def show_image(request: Request, node: int) -> Response:
    """Return one learned image as a small PNG."""
    image = await services_of(request).progress.image(node)
    if image is None:
        raise HTTPException(404, "Unknown image.")
    return Response(
        encode_png(image.thumbnail),
        media_type="image/png",
        headers={"cache-control": "private, max-age=600"},
    )


@router.post("/undo", dependencies=[PILOT])
async def undo_edit(request: Request) -> dict[str, bool]:
    """Undo the last change to an image; `undone` is false if there is none to undo."""
    undone = await services_of(request).change_learner(lambda history: history.undo_edit())
    await services_of(request).progress.gallery(fresh=True)
    return {"undone": bool(undone)}


@router.post("/{node}", dependencies=[PILOT])
async def edit_image(request: Request, node: int) -> dict[str, Any]:
    """Change one image: {verb: relabel, value: move}, {verb: pin, value: bool}, {verb: delete}."""
    body = await read_body(request)
    verb, value = body.get("verb"), body.get("value")
    if not isinstance(verb, str):
        raise HTTPException(400, "'verb' must be relabel, pin or delete.")
    services = services_of(request)
    try:
        await services.change_learner(lambda history: history.edit(verb, node, value))
    except LookupError as error:
        raise HTTPException(
            404, "That image is no longer there; it may have been merged."
        ) from error
    except ValueError as error:
        raise HTTPException(409, str(error)) from error
    await services.progress.gallery(fresh=True)
    return {"node": node}


def _describe(image: LearnedImage, progress: Progress) -> dict[str, Any]:
    mark = progress.mark_of(image.last_taught)
    return {
        "node": image.node_id,
        "votes": {move.value: count for move, count in image.votes.items()},
        "frames": image.frames,
        "last_used": image.last_used,
        "last_taught": image.last_taught,
        "taught_at_s": mark.at_s if mark else None,
        "episode": mark.episode if mark else None,
        "pinned": image.is_pinned,
    }
