"""Worlds as data: a rectangular room, the things in it, and the robot's start.

A world is a TOML file; the built-in worlds are in `robot/simulator/worlds/`. Lengths are in metres.
Angles are in degrees in the file, and in radians in this module. Colours are red, green and blue
from 0 to 255. The origin is a corner of the room; x runs along the room's width, y along its depth.
"""

from __future__ import annotations

import colorsys
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from robot.driver import Pose
from robot.errors import UNREADABLE, ConfigurationError, did_you_mean

Colour = tuple[int, int, int]
_FOLDER = Path(__file__).parent / "worlds"
_SHAPES = ("box", "cylinder")
_PATTERNS = ("plain", "carpet", "tiles")
WALLS = ("south", "east", "north", "west")
"""Names of the walls: south lies along x, at y = 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A thing in the room. A cylinder's `width_m` is its diameter.

    The robot can push the thing if `is_movable` is True. A thing with a closed `path` moves along
    this path; `gone_m` is the distance moved so far.
    """

    name: str
    shape: str
    x_m: float
    y_m: float
    width_m: float
    depth_m: float
    height_m: float
    heading_rad: float
    colour: Colour
    is_movable: bool = False
    path: tuple[tuple[float, float], ...] = ()
    speed_mps: float = 0.0
    gone_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """A room and the things in it."""

    name: str
    width_m: float
    depth_m: float
    wall_height_m: float
    wall_colours: tuple[Colour, ...]
    """Colours of the south, east, north and west wall: counter-clockwise from the origin."""
    floor_pattern: str
    floor_colours: tuple[Colour, ...]
    start: Pose
    start_spread_m: float
    start_spread_rad: float
    obstacles: tuple[Obstacle, ...]


def world_names() -> list[str]:
    """Return the names of the built-in worlds."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def load_world(name: str) -> World:
    """Load a built-in world by name, or any other world by the path of its TOML file."""
    path = _FOLDER / f"{name}.toml" if name in world_names() else Path(name)
    if not path.is_file():
        known = world_names()
        raise ConfigurationError(
            f"unknown world {name!r}{did_you_mean(name, known)}; choose one of: "
            f"{', '.join(known)}, or give the path of a TOML file"
        )
    try:
        return _parse(path.stem, tomllib.loads(path.read_text("utf-8-sig")))
    except UNREADABLE as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise ConfigurationError(f"the world {path} cannot be read: {what}") from error


def tinted(world: World, hue_deg: float) -> World:
    """Return the world with walls in another hue, so that people can tell several robots' rooms
    apart."""
    paint = [255 * part for part in colorsys.hsv_to_rgb(hue_deg / 360, 1.0, 1.0)]

    def mix(wall: Colour) -> Colour:
        red, green, blue = (round(0.6 * a + 0.4 * b) for a, b in zip(wall, paint, strict=True))
        return red, green, blue

    return replace(world, wall_colours=tuple(map(mix, world.wall_colours)))


def _parse(name: str, table: Mapping[str, Any]) -> World:
    room, start = table["room"], table["start"]
    world = World(
        name=name,
        width_m=_positive(room, "width_m"),
        depth_m=_positive(room, "depth_m"),
        wall_height_m=_positive(room, "wall_height_m"),
        wall_colours=tuple(
            _colour(room.get("wall_colours", {}).get(side, room["wall_colour"])) for side in WALLS
        ),
        floor_pattern=_one_of(room["floor_pattern"], _PATTERNS),
        floor_colours=tuple(_colour(colour) for colour in room["floor_colours"]),
        start=Pose(
            x_m=float(start["x_m"]),
            y_m=float(start["y_m"]),
            heading_rad=math.radians(start["heading_deg"]),
        ),
        start_spread_m=float(start.get("spread_m", 0.0)),
        start_spread_rad=math.radians(start.get("spread_deg", 0.0)),
        obstacles=tuple(_obstacle(part) for part in table.get("obstacle", ())),
    )
    if not (0 < world.start.x_m < world.width_m and 0 < world.start.y_m < world.depth_m):
        raise ValueError("the robot starts outside the room")
    return world


def _obstacle(part: Mapping[str, Any]) -> Obstacle:
    width_m = _positive(part, "width_m")
    return Obstacle(
        name=str(part["name"]),
        shape=_one_of(part["shape"], _SHAPES),
        x_m=float(part["x_m"]),
        y_m=float(part["y_m"]),
        width_m=width_m,
        depth_m=float(part.get("depth_m", width_m)),
        height_m=_positive(part, "height_m"),
        heading_rad=math.radians(part.get("heading_deg", 0.0)),
        colour=_colour(part["colour"]),
        is_movable=bool(part.get("movable", False)),
        path=tuple((float(x), float(y)) for x, y in part.get("path", ())),
        speed_mps=float(part.get("speed_mps", 0.0)),
    )


def _positive(table: Mapping[str, Any], key: str) -> float:
    value = float(table[key])
    if not 0 < value < 100:
        raise ValueError(f"{key} must lie between 0 and 100, not {value}")
    return value


def _colour(value: Any) -> Colour:
    red, green, blue = (int(part) for part in value)
    if not all(0 <= part <= 255 for part in (red, green, blue)):
        raise ValueError(f"a colour must be three numbers from 0 to 255, not {value}")
    return red, green, blue


def _one_of(value: Any, known: tuple[str, ...]) -> str:
    if value not in known:
        raise ValueError(f"unknown value {value!r}; choose one of: {', '.join(known)}")
    return str(value)
