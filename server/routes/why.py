"""`/api/why`: what the robot's present proposal rests on. See docs/reference/http.md."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Annotated

from fastapi import APIRouter, Request

from robot.control.loop import ControlLoop
from robot.policy.gallery import Explanation
from robot.types import Prediction
from server.routes.answers import Of, Route, answer, png_text
from server.services import services_of

router = APIRouter(route_class=Route)


def _png(path: str) -> Of:
    return Of(lambda explanation: png_text(attrgetter(path)(explanation)))


def _rows(explanation: Explanation) -> list[list[float]]:
    return [[round(float(part), 2) for part in row] for row in explanation.alike]


@dataclass
class Why:
    """The image that decides now beside the present view, both PNG in base64."""

    frame: int
    action: str | None
    novelty: float
    node: Annotated[int, Of(attrgetter("image.node_id"))]
    votes: Annotated[dict[str, int], Of(attrgetter("image.votes"))]
    frames: Annotated[int, Of(attrgetter("image.frames"))]
    present: Annotated[str, _png("present")]
    image: Annotated[str, _png("image.thumbnail")]
    alike: Annotated[list[list[float]], Of(_rows)]


@dataclass
class WhyAnswer:
    """What the present proposal rests on; null if nothing was taught."""

    why: Why | None


@router.get("/api/why")
async def show_why(request: Request) -> WhyAnswer:
    """Return the image that decides now beside the present view; null if there is none."""
    services = services_of(request)
    found = await services.on_loop(lambda: _explain(services.robot.loop))
    if found is None:
        return WhyAnswer(why=None)
    prediction, explanation = found
    why = answer(
        Why,
        explanation,
        frame=prediction.frame_id,
        action=prediction.action,
        novelty=round(float(prediction.novelty), 3),
    )
    return WhyAnswer(why=why)


def _explain(loop: ControlLoop) -> tuple[Prediction, Explanation] | None:
    """Explain the newest proposal; on the loop's thread."""
    newest = loop.learning.newest
    if newest is None:
        return None
    x, prediction = newest
    explanation = loop.history.policy.explain(x, prediction.node)
    return None if explanation is None else (prediction, explanation)
