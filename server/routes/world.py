"""`/api/world`: the simulated world from above, and the way that any robot went, for drawing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fastapi import APIRouter, Depends, Request

from server.security.guard import require_viewer
from server.services import services_of

if TYPE_CHECKING:  # a server on a brick never imports the simulation
    from robot.devices.simulation.world import Obstacle, World

router = APIRouter()


@router.get("/api/world", dependencies=[Depends(require_viewer)])
def show_world(request: Request) -> dict[str, Any]:
    """Return the world as it is now, in metres and radians; null for a real robot."""
    body: object = services_of(request).robot.driver
    if not hasattr(body, "simulation"):
        return {"world": None}
    return {"world": describe_world(body.simulation.world)}


@router.get("/api/path", dependencies=[Depends(require_viewer)])
def show_path(request: Request, since: int = 0) -> dict[str, Any]:
    """Return the points of the way from the one numbered `since` on, as columns.

    `first` is the number of the first of them: ask again with `first` and the points that came.
    """
    first, points = services_of(request).progress.trail.since(since)
    return {
        "first": first,
        "pose": [
            [round(p.pose.x_m, 3), round(p.pose.y_m, 3), round(p.pose.heading_rad, 2)]
            for p in points
        ],
        "driven_by": [point.driven_by.value for point in points],
        "events": {
            str(i): [event.value for event in point.events]
            for i, point in enumerate(points)
            if point.events
        },
        "is_estimate": any(point.pose.is_estimate for point in points),
    }


def describe_world(world: World) -> dict[str, Any]:
    """Return a world as the page draws it."""
    return {
        "name": world.name,
        "width_m": world.width_m,
        "depth_m": world.depth_m,
        "things": [_describe_thing(obstacle) for obstacle in world.obstacles],
    }


def _describe_thing(thing: Obstacle) -> dict[str, Any]:
    return {
        "name": thing.name,
        "shape": thing.shape,
        "x_m": thing.x_m,
        "y_m": thing.y_m,
        "width_m": thing.width_m,
        "depth_m": thing.depth_m,
        "heading_rad": thing.heading_rad,
        "moves": thing.is_movable or bool(thing.path),
    }
