"""`/api/teaching`: the training progress, and undo of the latest. See docs/reference/http.md."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from fastapi import APIRouter, HTTPException, Query, Request

from robot.coaching.readiness import Readiness
from robot.devices.raw_value import RawValue, number
from robot.policy.history import UNDO_HORIZON_S, TrainingHistory
from robot.policy.image import to_small_grey
from server.routes.answers import Route, answer, png_text
from server.services import services_of

router = APIRouter(prefix="/api/teaching", route_class=Route)
_LAST = Query(5.0, gt=0, le=UNDO_HORIZON_S, description="a number above 0 up to 35")
_STRIP = 24
"""How many frames a strip shows at most."""


class TrainingUndo(RawValue):
    """How much of the latest training is undone."""

    seconds: float = number(above=0, most=UNDO_HORIZON_S)


@dataclass
class Teaching:
    """What was taught, and the curve of agreement over the examples."""

    lessons: int
    taught: dict[str, int]
    agreement: float | None
    history: list[list[float]]


@dataclass
class GapAnswer:
    """One thing to show the robot; `png` is the view in which, base64."""

    kind: str
    move: str | None
    instead: str | None
    have: float
    need: float
    distance_m: float | None
    png: str | None


@dataclass
class ReadinessAnswer:
    """Whether the robot is ready to drive alone, or what is missing and where."""

    stage: str
    alone_s: float
    alone_needed_s: int
    unknown_share: float
    changes: int
    foreseen: int
    moves: Sequence[str]
    missing: list[GapAnswer]


@dataclass
class ExampleAnswer:
    """One example of a strip."""

    png: str
    frame: int
    label: str
    is_intervention: bool


@dataclass
class LastExamples:
    """The examples that undoing the last seconds would remove."""

    lessons: int
    taught: dict[str, int]
    strip: list[ExampleAnswer]


@router.get("")
def describe_teaching(request: Request) -> Teaching:
    """Return what was taught, and the curve of agreement over the examples."""
    state = services_of(request).robot.loop.state
    return Teaching(
        lessons=sum(state.taught.values()),
        taught={move.value: state.taught.get(move, 0) for move in state.moves},
        agreement=state.agreement,
        history=[
            [mark.n_examples, round(mark.agreement, 4)]
            for mark in services_of(request).progress.history()
        ],
    )


@router.get("/readiness")
async def show_readiness(request: Request, pictures: bool = True) -> ReadinessAnswer:
    """Return whether the robot is ready to drive alone, or what is missing and where."""
    services = services_of(request)
    readiness = services.progress.readiness
    return await services.on_loop(lambda: _describe_readiness(readiness, pictures))


@router.get("/last")
async def show_last(request: Request, seconds: float = _LAST) -> LastExamples:
    """Return the examples that undoing the last seconds would remove."""
    services = services_of(request)
    return await services.on_loop(lambda: _preview(services.robot.loop.history, seconds))


@router.post("/undo")
async def undo(request: Request, body: TrainingUndo) -> dict[str, int]:
    """Undo the last seconds of training."""
    services = services_of(request)
    gone = await services.change_learner(lambda history: history.undo(body.seconds))
    return {"undone": len(gone)}


@router.post("/outdate")
async def outdate(request: Request) -> dict[str, int]:
    """Let what is taught from now on count more than what was taught before."""
    services = services_of(request)
    try:
        await services.change_learner(lambda history: history.edit("outdate"))
    except ValueError as error:
        raise HTTPException(409, str(error)) from error
    return {"outdated": sum(services.robot.loop.state.taught.values())}


def _describe_readiness(readiness: Readiness, has_pictures: bool) -> ReadinessAnswer:
    """Describe it; on the loop's thread."""
    missing = []
    for gap in readiness.missing():
        png, frame = None, gap.frame
        if has_pictures and frame:
            png = png_text(to_small_grey(frame, frame.width // 2, frame.height // 2))
        missing.append(answer(GapAnswer, gap, have=round(gap.have, 1), png=png))
    return ReadinessAnswer(
        stage=readiness.stage,
        alone_s=round(readiness.clean_s, 1),
        alone_needed_s=math.ceil(readiness.needed_s),
        unknown_share=round(readiness.novel_share, 3),
        **readiness.foreseen,
        moves=readiness.moves_in_use,
        missing=missing,
    )


def _preview(history: TrainingHistory, seconds: float) -> LastExamples:
    """Describe the examples that undo would remove; on the loop's thread."""
    taught = history.last_examples(seconds)
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
