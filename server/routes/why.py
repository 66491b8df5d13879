"""`/api/why`: what the robot's present proposal rests on. See docs/reference/http.md."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Request

from robot.control.loop import ControlLoop
from robot.policy.explanation import Explanation, explain
from robot.types import Prediction
from server.routes.answers import Of, Route, answer, png_text
from server.services import services_of

router = APIRouter(route_class=Route)


def _png(name: str) -> Of:
    return Of(lambda explanation: png_text(getattr(explanation, name)))


def _rows(explanation: Explanation) -> list[list[float]]:
    return [[round(float(part), 2) for part in row] for row in explanation.alike]


@dataclass
class Why:
    """The image that decides now beside the present view, both PNG in base64."""

    frame: int
    action: str | None
    novelty: float
    node: Annotated[int, Of("node_id")]
    votes: dict[str, int]
    frames: int
    present: Annotated[str, _png("present")]
    image: Annotated[str, _png("image")]
    alike: Annotated[list[list[float]], Of(_rows)]


@dataclass
class WhyAnswer:
    """What the present proposal rests on; null if nothing was taught."""

    why: Why | None


@router.get("/api/why")
async def show_why(request: Request) -> WhyAnswer:
    """Return the image that decides now beside the present view; null if there is none."""
    loop = services_of(request).robot.loop
    found = await asyncio.wrap_future(loop.submit(lambda: _explain(loop)))
    return WhyAnswer(why=found and _describe(*found))


def _explain(loop: ControlLoop) -> tuple[Prediction, Explanation] | None:
    """Explain the newest proposal; on the loop's thread."""
    newest = loop.newest
    if newest is None:
        return None
    x, prediction = newest
    explanation = explain(loop.history.policy, x, prediction.node)
    return None if explanation is None else (prediction, explanation)


def _describe(prediction: Prediction, explanation: Explanation) -> Why:
    return answer(
        Why,
        explanation,
        frame=prediction.frame_id,
        action=prediction.action and prediction.action.value,
        novelty=round(float(prediction.novelty), 3),
    )
