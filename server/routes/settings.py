"""`/api/settings`: the settings that the page can change. See docs/reference/http.md."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal, get_args

from fastapi import APIRouter, Request

from robot.devices.raw_value import RawValue, must_be, number, text
from robot.errors import ConfigurationError
from robot.policy import autosize
from robot.policy.registry import split_name
from robot.types import Action
from server.clients.telemetry import describe_body
from server.identity import COLOURS
from server.routes.answers import Route
from server.routes.bodies import Short, do, require_free_model
from server.services import persistence_of, services_of

router = APIRouter(prefix="/api/settings", route_class=Route)
Size = Literal[16, 32, 64, 128, 256]
SIZES: tuple[int, ...] = get_args(Size)
"""The values of `max_nodes` that the page offers."""
_TRIALS = 10


class SettingsChange(RawValue):
    """A request's body: the settings to change."""

    speed: float | None = number(None, least=0.3, most=1.0)
    name: str | None = text(None)
    colour: str | None = text(None)
    max_nodes: Size | None = must_be(f"one of {', '.join(map(str, SIZES))}", None)
    moves: list[Short] | None = must_be("a list of moves", None)


@dataclass
class CameraAnswer:
    """The robot's camera; width and height are null before its first picture."""

    name: str
    rate_hz: float
    width: int | None
    height: int | None


@dataclass
class ChangeAnswer:
    """The settings after a change; `kept` is false if the next start would use the old model."""

    learner: str
    speed: float
    kept: bool


@dataclass
class SettingsAnswer:
    """The settings, and the values to which they can be set."""

    learner: str
    speed: float
    name: str
    colour: str
    colours: list[str]
    max_nodes: int
    sizes: list[dict[str, int]]
    moves: list[str]
    possible_moves: list[str]
    declared_moves: list[dict[str, Any]]
    takes_points: bool
    camera: CameraAnswer


@router.get("")
async def describe_settings(request: Request) -> SettingsAnswer:
    """Return the settings, and the values to which they can be set."""
    robot = services_of(request).robot
    state = robot.loop.state
    rates_hz = await do(estimate_rates_hz, split_name(state.learner)[0])
    frame = robot.camera.latest()
    identity = services_of(request).identity.now
    return SettingsAnswer(
        name=identity.name,
        colour=identity.colour,
        colours=list(COLOURS),
        learner=state.learner,
        max_nodes=state.max_nodes,
        sizes=[{"max_nodes": n, "rate_hz": round(rates_hz[n])} for n in SIZES],
        speed=robot.loop.speed_share,
        moves=[move.value for move in state.moves],
        possible_moves=[move.value for move in robot.driver.moves],
        **describe_body(robot.driver),
        camera=CameraAnswer(
            name=robot.camera.name,
            rate_hz=round(state.cycle_hz, 1),
            width=frame.width if frame else None,
            height=frame.height if frame else None,
        ),
    )


@router.put("")
async def change_settings(request: Request, body: SettingsChange) -> ChangeAnswer:
    """Change settings (409 while driving). New `max_nodes` or `moves` need a new, empty model."""
    services = services_of(request)
    loop = services.robot.loop
    given = {"name": body.name, "colour": body.colour}
    named = {field: value for field, value in given.items() if value is not None}
    replace(services.identity.now, **named)  # raises before anything changes if invalid
    is_kept = True
    if body.max_nodes is not None or body.moves is not None:
        require_free_model(request)
        kind, size = split_name(loop.state.learner)
        learner = f"{kind}-{body.max_nodes or size}"
        moves = loop.state.moves if body.moves is None else _choose(body.moves, request)
        kept = persistence_of(request)
        begun = await do(kept.autosave.begin, None, learner, None, moves)
        is_kept = kept.models.current == begun
    if named:
        now = await do(lambda: services.identity.change(**named))
        services.hub.broadcast.announce("renamed", robot=now.name, colour=now.colour)
    if body.speed is not None:
        loop.speed_share = body.speed
    return ChangeAnswer(loop.state.learner, loop.speed_share, is_kept)


def _choose(moves: list[str], request: Request) -> tuple[Action, ...]:
    possible = services_of(request).robot.driver.moves
    if not set(moves) <= {move.value for move in possible}:
        raise ConfigurationError(f"'moves' may contain only {', '.join(possible)}")
    if len(set(moves)) < 2:
        raise ConfigurationError("'moves' must contain at least two moves")
    return tuple(move for move in possible if move.value in moves)


@lru_cache(maxsize=8)
def estimate_rates_hz(kind: str) -> dict[int, float]:
    """Return how many pictures a second this machine can process, for each of `SIZES`.

    Only two sizes are measured, because the time per picture grows linearly with the size.
    """
    small, large = SIZES[0], SIZES[-2]
    frames = autosize.sample_frames(4)
    small_s, large_s = (
        autosize.measure(size, kind=kind, repeats=_TRIALS, frames=frames).frame_s
        for size in (small, large)
    )
    slope_s = max(0.0, (large_s - small_s) / (large - small))
    return {n: 1 / (small_s + slope_s * (n - small)) for n in SIZES}
