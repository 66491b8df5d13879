"""`/api/why`: what the robot's present proposal rests on. See docs/reference/http.md."""

from __future__ import annotations

from dataclasses import dataclass

from fastapi import APIRouter, Request

from robot.control.loop import ControlLoop
from robot.policy.gallery import Explanation
from robot.types import Prediction
from server.routes.answers import Route, png_text
from server.services import services_of

router = APIRouter(route_class=Route)


@dataclass
class Why:
    """The image that decides now beside the present view, both PNG in base64."""

    frame: int
    action: str | None
    novelty: float
    node: int
    votes: dict[str, int]
    frames: int
    present: str
    image: str
    alike: list[list[float]]


@router.get("/api/why")
async def show_why(request: Request) -> dict[str, Why | None]:
    """Return the image that decides now beside the present view; null if there is none."""
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


def _explain(loop: ControlLoop) -> tuple[Prediction, Explanation] | None:
    """Explain the newest proposal; on the loop's thread."""
    newest = loop.learning.newest
    if newest is None:
        return None
    x, prediction = newest
    explanation = loop.history.policy.gallery.explain(x, prediction.node)
    return None if explanation is None else (prediction, explanation)
