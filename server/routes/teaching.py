"""`/api/teaching`: undo the last seconds of training. See docs/reference/http.md."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from fastapi import APIRouter, Query, Request

from robot.devices.raw_value import RawValue, number
from robot.policy.history import UNDO_HORIZON_S, TrainingHistory
from robot.policy.undo import last_examples, undo_examples
from server.routes.answers import Route, png_text
from server.services import services_of

router = APIRouter(prefix="/api/teaching", route_class=Route)
_LAST = Query(5.0, gt=0, le=UNDO_HORIZON_S, description="a number above 0, at most 35")
_STRIP = 24
"""Maximum number of examples in an answer that shows what undo would remove."""


class TrainingUndo(RawValue):
    """A request's body: how many of the last seconds of training to undo."""

    seconds: float = number(above=0, most=UNDO_HORIZON_S)


@dataclass
class ExampleAnswer:
    """One of the examples that undo would remove."""

    png: str
    frame: int
    label: str
    is_intervention: bool


@dataclass
class LastExamples:
    """The examples that undo would remove."""

    lessons: int
    taught: dict[str, int]
    strip: list[ExampleAnswer]


@router.get("/last")
async def show_last(request: Request, seconds: float = _LAST) -> LastExamples:
    """Return the examples of the last seconds, which undo would remove."""
    services = services_of(request)
    return await services.on_loop(lambda: _preview(services.robot.loop.history, seconds))


@router.post("/undo")
async def undo(request: Request, body: TrainingUndo) -> dict[str, int | bool]:
    """Undo the last seconds of training; `kept` is false if the model could not be saved."""
    services = services_of(request)
    seconds = body.seconds
    gone, is_kept = await services.change_learner(lambda history: undo_examples(history, seconds))
    return {"undone": len(gone), "kept": is_kept}


def _preview(history: TrainingHistory, seconds: float) -> LastExamples:
    """Describe the examples that undo would remove. Only the loop's thread may call it."""
    taught = last_examples(history, seconds)
    step = max(1, -(-len(taught) // _STRIP))
    labels = Counter(event.example.label for event in taught)
    picture = history.policy.features.thumbnail
    return LastExamples(
        lessons=len(taught),
        taught={move.value: labels[move] for move in history.policy.moves},
        strip=[
            ExampleAnswer(
                png=png_text(picture(event.x)),
                frame=event.example.frame_id,
                label=event.example.label,
                is_intervention=event.example.is_intervention,
            )
            for event in taught[::step]
        ],
    )
