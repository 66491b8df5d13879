"""`/api/world`: the simulated world from above, for drawing; unknown for a real robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fastapi import APIRouter, Depends, Request

from server.security.guard import require_viewer
from server.services import services_of

if TYPE_CHECKING:  # a server on a brick never imports the simulation
    from robot.simulation.world import Obstacle, World

router = APIRouter()


@router.get("/api/world", dependencies=[Depends(require_viewer)])
def show_world(request: Request) -> dict[str, Any]:
    """Return the world as it is now, in metres and radians; null for a real robot."""
    body: object = services_of(request).robot.driver
    if not hasattr(body, "simulation"):
        return {"world": None}
    return {"world": describe_world(body.simulation.world)}


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
    }
