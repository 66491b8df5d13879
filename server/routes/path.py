"""`/api/path`: the way that the robot went, for drawing."""

from __future__ import annotations

from dataclasses import dataclass

from fastapi import APIRouter, Request

from server.routes.answers import Route
from server.services import services_of

router = APIRouter(route_class=Route)


@dataclass
class PathAnswer:
    """Points of a way, as columns."""

    first: int
    pose: list[list[float]]
    driven_by: list[str]
    events: dict[str, list[str]]
    is_estimate: bool


@router.get("/api/path")
def show_path(request: Request, since: int = 0) -> PathAnswer:
    """Return the points of the way from the one numbered `since` on, as columns.

    `first` is the number of the first of them: ask again with `first` and the points that came.
    """
    first, points = services_of(request).progress.trail.since(since)
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
