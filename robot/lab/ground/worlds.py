"""Third-party worlds, each with a scripted teacher; Gymnasium is imported when a world is made."""

from __future__ import annotations

import math
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import ConfigurationError, did_you_mean, need
from robot.moves import Move, move_at, side_of
from robot.types import Action, Point

Picture = NDArray[np.uint8]
"""A picture in RGB, shape (height, width, 3)."""
STEP_S = 0.1
"""Time from one decision to the next, in seconds."""
_HALF_WIDTH_M = 0.45
"""Half the width of a lane that is wide enough for MiniWorld's agent, in metres. The agent is 80 cm
wide."""


class ForeignWorld(ABC):
    """One third-party world: episodes of pictures and moves, a score, and a scripted teacher that
    knows the true state.

    Attributes:
        codes: Maps each move to its number in the world.
        longest: Maximum number of decisions in an episode.
        frames: Number of steps in which the world repeats the move of one decision.
        score: The score of the episode so far.
        point: Steering and throttle of the teacher's `wanted` move. None if the world does not
            support proportional steering.
    """

    codes: Mapping[str, int]
    longest: int
    frames = 1

    def __init__(self, name: str, package: str, **options: Any) -> None:
        gymnasium = need("gymnasium", f"the world {name}", "ground")
        need(package, f"the world {name}", "ground")
        self._env = gymnasium.make(name, **options)
        self.inner: Any = self._env.unwrapped
        self.moves = tuple(self.codes)
        self.point: Point | None = None
        self.score = 0.0
        self._n_steps = 0

    def reset(self, seed: int) -> Picture:
        """Begin an episode and return its first picture."""
        seen, _ = self._env.reset(seed=seed)
        self.score, self._n_steps = 0.0, 0
        return self._picture(seen)

    def step(self, move: str, point: Point | None = None) -> tuple[Picture, bool]:
        """Make a move; `point` may give its steering and throttle. Return the next picture, and
        whether it is the last picture."""
        self._n_steps += 1
        is_over = self._n_steps >= self.longest
        for frame in range(self.frames):
            self._is_seen = frame == self.frames - 1
            seen, reward, *ends, _ = self._env.step(self._code(move, point))
            self._note(float(reward))
            is_over = is_over or any(ends)
            if is_over:
                break
        return self._picture(seen), is_over

    @abstractmethod
    def wanted(self) -> str:
        """Return the move that the teacher would make now."""

    def close(self) -> None:
        self._env.close()

    def _code(self, move: str, point: Point | None) -> Any:
        return self.codes[move]

    def _picture(self, seen: Any) -> Picture:
        return np.asarray(seen)

    @abstractmethod
    def _note(self, reward: float) -> None:
        """Note the result that the world returned for a step."""


class MiniWorld(ForeignWorld):
    """Rooms with a red box as the goal. The score is 1 if the box was reached.

    The teacher drives to the box if it is in sight. If the box is out of sight, the teacher drives
    straight, and turns at obstacles until the way is free. Everything that the teacher uses is
    visible in the pictures.
    """

    codes: Mapping[str, int] = MappingProxyType({"left": 0, "right": 1, "forward": 2})
    longest = 300

    def __init__(self, name: str) -> None:
        os.environ.setdefault("PYGLET_HEADLESS", "1")
        self._is_convex = name == "OneRoom"
        super().__init__(f"MiniWorld-{name}-v0", "miniworld", obs_width=160, obs_height=120)

    def reset(self, seed: int) -> Picture:
        self._turning: str | None = None
        return super().reset(seed)

    def _note(self, reward: float) -> None:
        self.score = max(self.score, float(reward > 0.0))

    def wanted(self) -> str:
        agent, box = self.inner.agent, self.inner.box
        way = box.pos - agent.pos
        bearing = math.remainder(math.atan2(-way[2], way[0]) - agent.dir, math.tau)
        distance = math.hypot(way[0], way[2])
        is_seen = abs(bearing) < math.radians(36.0) and self._free_m(bearing, distance) >= distance
        if is_seen and self._free_m(bearing, min(distance, 1.5), _HALF_WIDTH_M) > 0.5:
            self._turning = None
            aim = math.radians(10.0)
            return "forward" if abs(bearing) < aim else "left" if bearing > 0.0 else "right"
        free_m = self._free_m(0.0, 2.0, _HALF_WIDTH_M)
        if self._is_convex:
            return "left"
        if self._turning is None and free_m < 0.7:
            left, right = (self._free_m(math.radians(side)) for side in (35.0, -35.0))
            self._turning = "right" if right > left + 0.5 else "left"
        elif free_m > 1.5:
            self._turning = None
        return self._turning or "forward"

    def _free_m(self, bearing: float, most_m: float = 4.0, half_width_m: float = 0.0) -> float:
        """Return the free length of a lane in a direction; `bearing` is counter-clockwise from
        straight ahead."""
        heading = self.inner.agent.dir + bearing
        ahead = np.array([math.cos(heading), 0.0, -math.sin(heading)])
        aside = half_width_m * np.array([ahead[2], 0.0, -ahead[0]])
        for free_m in np.arange(0.2, most_m, 0.2):
            middle = self.inner.agent.pos + free_m * ahead
            sides = (middle - aside, middle + aside) if half_width_m else (middle,)
            if not all(self._is_free(point) for point in sides):
                return float(free_m)
        return most_m

    def _is_free(self, point: NDArray[np.float64]) -> bool:
        street = getattr(self.inner, "street", None)
        inside = [room for room in self.inner.rooms if room.point_inside(point)]
        return bool(inside) and street not in inside


class CarRacing(ForeignWorld):
    """A car on a race track. The score is the percentage of the track's tiles that the car
    visited.

    The moves are the five discrete actions of CarRacing: left, right, gas, brake and nothing. The
    teacher knows the track. A move either steers or accelerates, so the teacher steers only if the
    track ahead lies far to one side. The teacher drives slower in bends.

    Args:
        names: The names of left, right, gas, brake and nothing.
        is_continuous: True if the world is driven proportionally.
    """

    longest = 150
    frames = 4
    look_ahead = 6
    _zoom_frames = 50
    """Length of the zoom at the start of an episode, in frames. Moves have no effect during
    the zoom."""

    def __init__(self, names: Collection[str], *, is_continuous: bool = False) -> None:
        self.codes = dict(zip(names, (2, 1, 3, 4, 0), strict=True))
        self._names = tuple(names)
        super().__init__("CarRacing-v3", "Box2D", continuous=is_continuous)
        self._draw = self.inner._render
        self._is_seen = True
        # Do not draw frames that are not shown, because drawing takes most of the time of a step.
        self.inner._render = lambda mode: self._draw(mode) if self._is_seen else self.inner.state

    def _picture(self, seen: Any) -> Picture:
        return np.asarray(seen).repeat(2, axis=0).repeat(2, axis=1)

    def reset(self, seed: int) -> Picture:
        super().reset(seed)
        for frame in range(self._zoom_frames):
            self._is_seen = frame == self._zoom_frames - 1
            seen, *_ = self._env.step(self._code(self._names[-1], None))
        return self._picture(seen)

    def _note(self, reward: float) -> None:
        self.score = 100.0 * self.inner.tile_visited_count / len(self.inner.track)

    def wanted(self) -> str:
        left, right, gas, brake, nothing = self._names
        bearing, speed, fastest = self._ahead()
        if abs(bearing) > 0.25 and speed > 5.0:
            return left if bearing > 0.0 else right
        if speed > 1.3 * fastest:
            return brake
        return gas if speed < fastest else nothing

    def _ahead(self) -> tuple[float, float, float]:
        """Return the bearing of a point ahead, the speed, and the maximum speed for the next
        bend."""
        hull = self.inner.car.hull
        track = np.array([tile[2:4] for tile in self.inner.track])
        here = np.array(hull.position)
        nearest = int(((track - here) ** 2).sum(axis=1).argmin())
        speed = float(np.hypot(*hull.linearVelocity))
        bearing = self._bearing(track, here, nearest + self.look_ahead + int(speed / 20))
        bend = abs(self._bearing(track, here, nearest + 12))
        return bearing, speed, 63.0 if bend < 0.25 else 46.0 if bend < 0.6 else 34.5

    def _bearing(self, track: NDArray[np.float64], here: NDArray[np.float64], index: int) -> float:
        """Return the direction of a point of the track, counter-clockwise from straight ahead."""
        x, y = track[index % len(track)] - here
        return math.remainder(math.atan2(y, x) - math.pi / 2 - self.inner.car.hull.angle, math.tau)


CAR_MOVES = {
    "left": Point(-0.6, 0.1),
    "right": Point(0.6, 0.1),
    "forward": Point(0.0, 0.2),
    "brake": Point(0.0, -0.8),
    "coast": Point(0.0, 0.0),
}
"""The five discrete moves of CarRacing, each as steering and throttle for the continuous action
space."""


class ProportionalCarRacing(CarRacing):
    """CarRacing with a continuous action space. The world has the same five moves as `CarRacing`,
    each with a fixed steering and throttle.

    The teacher steers towards a point ahead, in proportion to the point's bearing. The teacher
    accelerates at the same time.
    """

    def __init__(self) -> None:
        super().__init__(CAR_MOVES, is_continuous=True)
        self._moves = [
            Move(Action(name), steering=point.steering, throttle=point.throttle)
            for name, point in CAR_MOVES.items()
        ]

    def _code(self, move: str, point: Point | None) -> Any:
        steering, throttle = point or CAR_MOVES[move]
        return np.array([steering, max(throttle, 0.0), max(-throttle, 0.0)], np.float32)

    def wanted(self) -> str:
        """Steer to a point ahead, in proportion to its bearing.

        If the teacher coasts or brakes in a bend, it still steers, so the move counts as a turn.
        """
        bearing, speed, fastest = self._ahead()
        throttle = -0.8 if speed > 1.3 * fastest else 0.2 if speed < fastest else 0.0
        self.point = Point(min(max(-1.2 * bearing, -1.0), 1.0), throttle)
        turn = {-1: "left", 1: "right"}.get(side_of(self.point.steering))
        return turn or move_at(self.point, self._moves) or "coast"


class VizDoom(ForeignWorld):
    """ViZDoom's scenario of gathering health on a floor of acid. The score is the number of tics
    survived, at most 2,100.

    The teacher drives to the medikit that looks largest, and turns left if there is none in sight.
    """

    codes: Mapping[str, int] = MappingProxyType({"left": 3, "right": 2, "forward": 1})
    _skips = 4
    longest = 2101 // _skips + 1

    def __init__(self) -> None:
        super().__init__(
            "VizdoomHealthGathering-v1",
            "vizdoom.gymnasium_wrapper",
            frame_skip=self._skips,
            labels_buffer_enabled=True,
        )

    def _picture(self, seen: Any) -> Picture:
        picture: Picture = seen["screen"]
        return picture

    def _note(self, reward: float) -> None:
        self.score = float(self.inner.game.get_episode_time() - 1)

    def wanted(self) -> str:
        state = self.inner.game.get_state()
        labels = () if state is None else state.labels
        kits = [label for label in labels if label.object_name == "Medikit"]
        if not kits:
            return "left"
        aside, width = max(
            (((kit.x + kit.width / 2) / 160.0 - 1.0, kit.width / 320.0) for kit in kits),
            key=lambda place: place[1] - 0.03 * abs(place[0]),
        )
        if abs(aside) < 0.2 + 0.5 * width:
            return "forward"
        return "left" if aside < 0.0 else "right"


WORLDS: dict[str, Callable[[], ForeignWorld]] = {
    **{
        name: partial(MiniWorld, name)
        for name in ("Sidewalk", "Hallway", "OneRoom", "TMaze", "YMaze")
    },
    "CarRacing": partial(CarRacing, CAR_MOVES),
    "CarRacing, proportional": ProportionalCarRacing,
    "CarRacing, own names": partial(CarRacing, ("port", "starboard", "gas", "drag", "roll")),
    "ViZDoom": VizDoom,
}


def make_world(name: str) -> ForeignWorld:
    """Return a world by its name.

    Raises:
        ConfigurationError: If there is no world of this name.
        MissingExtraError: If its library is not installed.
    """
    if name not in WORLDS:
        raise ConfigurationError(
            f"unknown world {name!r}{did_you_mean(name, WORLDS)}; choose one of: "
            f"{', '.join(WORLDS)}"
        )
    return WORLDS[name]()
