"""`/api/teaching` and `/api/path`: progress, readiness and the driven path.

See docs/reference/http.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fastapi import APIRouter, Request

from robot.policy.image import to_small_grey
from server.coaching.extension import progress_of
from server.coaching.progress import Progress
from server.routes.answers import Route, answer, png_text
from server.services import services_of

router = APIRouter(prefix="/api", route_class=Route)


@dataclass
class Teaching:
    """The number of examples, and how the agreement has changed during teaching."""

    lessons: int
    taught: dict[str, int]
    agreement: float | None
    history: list[list[float]]


@dataclass
class GapAnswer:
    """One gap in the training: what to teach, and in `png` (base64) a view in which to teach it."""

    kind: str
    move: str | None
    instead: str | None
    have: float
    need: float
    distance_m: float | None
    png: str | None


@dataclass
class ReadinessAnswer:
    """The robot's readiness to drive autonomously, and the gaps in its training."""

    stage: str
    alone_s: float
    alone_needed_s: int
    unknown_share: float
    changes: int
    foreseen: int
    moves: Sequence[str]
    missing: list[GapAnswer]


@dataclass
class PathAnswer:
    """Points of the driven path; each field is a list with a value for each point."""

    first: int
    pose: list[list[float]]
    driven_by: list[str]
    events: dict[str, list[str]]
    is_estimate: bool


@router.get("/path")
def show_path(request: Request, since: int = 0) -> PathAnswer:
    """Return the points of the driven path from number `since` on.

    `first` is the number of the first point in the answer. For the next points, add the number of
    points to `first`, and request this number as `since`.
    """
    first, points = progress_of(request).trail.since(since)
    return PathAnswer(
        first=first,
        pose=[
            [round(p.pose.x_m, 3), round(p.pose.y_m, 3), round(p.pose.heading_rad, 2)]
            for p in points
        ],
        driven_by=[point.driven_by.value for point in points],
        events={
            str(i): [event.value for event in point.events]
            for i, point in enumerate(points)
            if point.events
        },
        is_estimate=any(point.pose.is_estimate for point in points),
    )


@router.get("/teaching")
def describe_teaching(request: Request) -> Teaching:
    """Return the number of examples, and how the agreement has changed during teaching."""
    state = services_of(request).robot.loop.state
    return Teaching(
        lessons=sum(state.taught.values()),
        taught={move.value: state.taught.get(move, 0) for move in state.moves},
        agreement=state.agreement,
        history=[
            [mark.n_examples, round(mark.agreement, 4)] for mark in progress_of(request).history()
        ],
    )


@router.get("/teaching/readiness")
async def show_readiness(request: Request, pictures: bool = True) -> ReadinessAnswer:
    """Return the robot's readiness to drive autonomously, and the gaps in its training."""
    progress = progress_of(request)
    services = services_of(request)
    return await services.on_loop(lambda: _describe_readiness(progress, pictures))


def _describe_readiness(progress: Progress, has_pictures: bool) -> ReadinessAnswer:
    """Describe the readiness. Only the loop's thread may call it."""
    lesson, missing = progress.lesson, []
    for gap in lesson.missing():
        png, frame = None, gap.frame
        if has_pictures and frame:
            png = png_text(to_small_grey(frame, -(-frame.width // 2), -(-frame.height // 2)))
        missing.append(answer(GapAnswer, gap, have=round(gap.have, 1), png=png))
    return ReadinessAnswer(
        stage=lesson.stage,
        alone_s=round(lesson.trial.clean_s, 1),
        alone_needed_s=math.ceil(lesson.trial.needed_s),
        unknown_share=round(lesson.trial.novel_share, 3),
        changes=len(lesson.foreseen),
        foreseen=sum(lesson.foreseen),
        moves=lesson.moves_in_use,
        missing=missing,
    )
