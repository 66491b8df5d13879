"""`/api/gallery`: the learned images. `/api/why`: the reason for the robot's current proposal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fastapi import APIRouter, HTTPException, Request, Response
from pydantic import StrictBool, StrictStr

from robot.coaching.gallery import Explanation, LearnedImage, explain
from robot.control.loop import ControlLoop
from robot.devices.raw_value import RawValue, must_be
from robot.policy import undo
from robot.types import Prediction
from server.coaching.extension import progress_of
from server.coaching.progress import Progress
from server.routes.answers import PNG, Route, answer, png, png_text
from server.services import services_of

router = APIRouter(prefix="/api", route_class=Route)


class ImageEdit(RawValue):
    """A request's body: relabel an image (`value` is a move), pin it (a bool) or delete it."""

    verb: Literal["relabel", "pin", "delete"] = must_be("relabel, pin or delete")
    value: StrictBool | StrictStr | None = must_be("a move, true or false", None)


@dataclass
class ImageAnswer:
    """One learned image.

    `taught_at_s` and `episode` say when and in which recording the image got its last example, if
    known. `angle` is the mean steering of the image's frames, after proportional steering.
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
    """The learned images, in the order in which the learner stores them."""

    moves: list[str]
    max_nodes: int
    images: list[ImageAnswer]


@dataclass
class Why:
    """The learned image that decides the robot's move now, and the robot's current view.

    Both pictures are PNG in base64.
    """

    frame: int
    action: str | None
    novelty: float
    node: int
    votes: dict[str, int]
    frames: int
    present: str
    image: str
    alike: list[list[float]]


@router.get("/gallery")
async def list_images(request: Request) -> ImageList:
    """List the learned images, in the learner's own order."""
    progress = progress_of(request)
    state = services_of(request).robot.loop.state
    images = await progress.gallery.images()
    return ImageList(
        moves=[move.value for move in state.moves],
        # The learner of a plug-in may store more images than it declares.
        max_nodes=max(state.max_nodes, len(images)),
        images=[_describe(image, progress) for image in images],
    )


@router.get("/gallery/{node}.png", **PNG)
async def show_image(request: Request, node: int) -> Response:
    """Return one learned image as a small PNG."""
    image = await progress_of(request).gallery.image(node)
    if image is None:
        raise HTTPException(404, "Unknown image.")
    return png(image.thumbnail, keep_s=600)


@router.post("/gallery/undo")
async def undo_edit(request: Request) -> dict[str, bool]:
    """Undo the last change to an image; `undone` is false if there is no change to undo.

    `kept` is false if the model could not be saved.
    """
    services = services_of(request)
    undone, is_kept = await services.change_learner(undo.undo_edit)
    await progress_of(request).gallery.images(fresh=True)
    return {"undone": bool(undone), "kept": is_kept}


@router.post("/gallery/{node}")
async def edit_image(request: Request, node: int, body: ImageEdit) -> dict[str, int | bool]:
    """Change one image; `kept` is false if the model could not be saved."""
    services = services_of(request)
    try:
        _, is_kept = await services.change_learner(
            lambda history: history.edit(body.verb, node, body.value)
        )
    except LookupError as error:
        raise HTTPException(
            404, "That image is no longer there; it may have been merged."
        ) from error
    except ValueError as error:
        raise HTTPException(409, str(error)) from error
    await progress_of(request).gallery.images(fresh=True)
    return {"node": node, "kept": is_kept}


@router.get("/why")
async def show_why(request: Request) -> dict[str, Why | None]:
    """Return the learned image that decides the robot's move now, with the current view.

    Null if no image decides.
    """
    services = services_of(request)
    found = await services.on_loop(lambda: _explain(services.robot.loop))
    if found is None:
        return {"why": None}
    prediction, explanation = found
    image = explanation.image
    why = Why(
        frame=prediction.frame_id,
        action=prediction.action,
        novelty=round(float(prediction.novelty), 3),
        node=image.node_id,
        votes={move.value: count for move, count in image.votes.items()},
        frames=image.frames,
        present=png_text(explanation.present),
        image=png_text(image.thumbnail),
        alike=[[round(float(part), 2) for part in row] for row in explanation.alike],
    )
    return {"why": why}


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


def _explain(loop: ControlLoop) -> tuple[Prediction, Explanation] | None:
    """Explain the newest prediction; None if there is none. Only the loop's thread may call it."""
    newest = loop.learning.newest
    if newest is None:
        return None
    x, prediction = newest
    explanation = explain(loop.history.policy, x, prediction.node)
    return None if explanation is None else (prediction, explanation)
