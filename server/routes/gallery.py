"""`/api/gallery`: the learned images. See docs/reference/http.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fastapi import APIRouter, HTTPException, Request, Response
from pydantic import StrictBool, StrictStr

from robot.devices.outside import Outside, must_be
from robot.policy.gallery import LearnedImage
from server.progress import Progress
from server.routes.answers import PNG, Route, answer, png
from server.services import services_of

router = APIRouter(prefix="/api/gallery", route_class=Route)


class ImageEdit(Outside):
    """Relabel an image (the value is a move), pin it (true or false), or delete it."""

    verb: Literal["relabel", "pin", "delete"] = must_be("relabel, pin or delete")
    value: StrictBool | StrictStr | None = must_be("a move, true or false", None)


@dataclass
class ImageAnswer:
    """One learned image; `taught_at_s` and `episode` if its last example is remembered.

    `angle` is how its frames were steered, on the mean, if by degrees.
    """

    taught_at_s: float | None
    episode: str | None
    node: int
    votes: dict[str, float]
    frames: int
    last_used: int
    last_taught: int
    pinned: bool
    angle: float | None


@dataclass
class ImageList:
    """The learned images, in the learner's own order."""

    moves: list[str]
    max_nodes: int
    images: list[ImageAnswer]


@router.get("")
async def list_images(request: Request) -> ImageList:
    """List the learned images, in the learner's own order."""
    progress = services_of(request).progress
    state = services_of(request).robot.loop.state
    images = await progress.gallery()
    return ImageList(
        moves=[move.value for move in state.moves],
        # A learner of somebody's own may keep more images than its name says.
        max_nodes=max(state.max_nodes, len(images)),
        images=[_describe(image, progress) for image in images],
    )


@router.get("/{node}.png", **PNG)
async def show_image(request: Request, node: int) -> Response:
    """Return one learned image as a small PNG."""
    image = await services_of(request).progress.image(node)
    if image is None:
        raise HTTPException(404, "Unknown image.")
    return png(image.thumbnail, keep_s=600)


@router.post("/undo")
async def undo_edit(request: Request) -> dict[str, bool]:
    """Undo the last change to an image; `undone` is false if there is none to undo."""
    undone = await services_of(request).change_learner(lambda history: history.undo_edit())
    await services_of(request).progress.gallery(fresh=True)
    return {"undone": bool(undone)}


@router.post("/{node}")
async def edit_image(request: Request, node: int, body: ImageEdit) -> dict[str, int]:
    """Change one image."""
    services = services_of(request)
    try:
        await services.change_learner(lambda history: history.edit(body.verb, node, body.value))
    except LookupError as error:
        raise HTTPException(
            404, "That image is no longer there; it may have been merged."
        ) from error
    except ValueError as error:
        raise HTTPException(409, str(error)) from error
    await services.progress.gallery(fresh=True)
    return {"node": node}


def _describe(image: LearnedImage, progress: Progress) -> ImageAnswer:
    mark = progress.mark_of(image.last_taught)
    return answer(
        ImageAnswer,
        image,
        taught_at_s=mark and mark.at_s,
        episode=mark and mark.episode,
        node=image.node_id,
        pinned=image.is_pinned,
    )
