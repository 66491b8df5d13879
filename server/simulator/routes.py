"""`/api/world`: shows the simulated world from above, and changes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter, Request

from robot.devices.raw_value import RawValue, text
from robot.errors import ConfigurationError
from robot.types import Mode
from server.routes.answers import Route, answer
from server.routes.bodies import FREE_MODEL
from server.services import Extension, services_of

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
    moves: bool


@dataclass
class WorldMap:
    """A world as the page draws it from above."""

    name: str
    width_m: float
    depth_m: float
    things: list[ThingAnswer]


@dataclass
class WorldAnswer:
    """The current world, in metres and radians, and the worlds that the robot can enter.

    For a real robot, the world is null and the list is empty.
    """

    world: WorldMap | None
    worlds: list[str]


class WorldChange(RawValue):
    """A request's body: the world to which the robot is carried."""

    name: str = text()


@router.get("/api/world")
def show_world(request: Request) -> WorldAnswer:
    """Return the current world, in metres and radians; null for a real robot."""
    body: object = services_of(request).robot.driver
    if not hasattr(body, "simulation"):
        return WorldAnswer(world=None, worlds=[])
    world = body.simulation.shown_world
    things = [
        answer(ThingAnswer, thing, moves=thing.is_movable or bool(thing.path))
        for thing in world.obstacles
    ]
    return WorldAnswer(
        world=answer(WorldMap, world, things=things), worlds=sorted(getattr(body, "worlds", ()))
    )


@router.put("/api/world", dependencies=[FREE_MODEL])
async def change_world(request: Request, body: WorldChange) -> WorldAnswer:
    """Carry a simulated robot to the start of another world, with its model.

    Answers 409 if the robot is not stopped, or while an extension needs the model unchanged.
    """
    services = services_of(request)
    driver: Any = services.robot.driver
    if not hasattr(driver, "worlds"):
        raise ConfigurationError("only a simulated robot can be carried to another world")

    def carry() -> None:
        if services.robot.loop.mode is not Mode.STOPPED:
            raise ConfigurationError("stop the robot before you carry it to another world")
        driver.enter(body.name)
        services.note_carried()

    await services.on_loop(carry)
    return show_world(request)


class SimulatorExtension(Extension):
    """Adds the routes of the simulated world to a robot's server."""

    routers = (router,)
