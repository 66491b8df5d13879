"""`/api/world`: the simulated world from above, and the way that any robot went, for drawing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Request

from server.routes.answers import Of, Route, answer
from server.security.guard import VIEWER
from server.services import services_of

router = APIRouter(route_class=Route)


@dataclass
class ThingAnswer:
    """One thing in a simulated world."""

    name: str
    shape: str
    x_m: float
    y_m: float
    width_m: float
    depth_m: float
    heading_rad: float
    moves: Annotated[bool, Of(lambda thing: thing.is_movable or bool(thing.path))]


@dataclass
class WorldMap:
    """A world as the page draws it."""

    name: str
    width_m: float
    depth_m: float
    things: list[ThingAnswer]


@dataclass
class WorldAnswer:
    """The world as it is now, in metres and radians; null for a real robot."""

    world: WorldMap | None


@dataclass
class PathAnswer:
    """Points of a way, as columns."""

    first: int
    pose: list[list[float]]
    driven_by: list[str]
    events: dict[str, list[str]]
    is_estimate: bool


@router.get("/api/world", dependencies=[VIEWER])
def show_world(request: Request) -> WorldAnswer:
    """Return the world as it is now, in metres and radians; null for a real robot."""
    body: object = services_of(request).robot.driver
    if not hasattr(body, "simulation"):
        return WorldAnswer(world=None)
    world = body.simulation.world
    things = [answer(ThingAnswer, thing) for thing in world.obstacles]
    return WorldAnswer(world=answer(WorldMap, world, things=things))


@router.get("/api/path", dependencies=[VIEWER])
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
