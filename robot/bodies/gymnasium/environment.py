"""A Gymnasium environment with pictures: opened, stepped and closed on one thread; and its moves.

What it is given for each move is told by its own names, or by a table.
"""

from __future__ import annotations

import importlib
import json
import os
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.devices.wheels import USUAL_THROTTLE
from robot.driver import Move, side_of
from robot.errors import CameraError, ConfigurationError, need, told_as
from robot.types import Action, Game, Point

Pixels = NDArray[np.uint8]
PICTURES = ("auto", "observed", "rendered")
_CAR_RACING = (
    "left=-0.6,0.1,0; right=0.6,0.1,0; forward=0,0.3,0; brake=0,0,0.5; coast=0,0,0",
    "left=2; right=1; forward=3; brake=4; coast=0",
)
"""Its moves have no names: tables for its continuous and its discrete form."""
_SIDES = {"left": -1.0, "right": 1.0}
"""Steering of moves with such a word in their names: on the page they stand on that side."""
_STANDING = ("noop", "coast", "nothing", "stop")
_BACK = ("back", "down", "brake")
_HELP = (
    "name its moves with --env-moves, such as 'left=-0.6,0,0; right=0.6,0,0; forward=0,0.3,0' "
    "(numbers for each move), or 'left=0; right=1' for one that numbers its actions"
)


def read_options(text: str) -> dict[str, Any]:
    """Return what `obs_width=160,domain_rand=true` says, for the environment's maker;
    ConfigurationError if it says nothing of the kind."""
    options: dict[str, Any] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = part.partition("=")
        if not equals or not name.isidentifier():
            raise ConfigurationError(f"--env-options: {part!r} is not NAME=VALUE")
        try:
            options[name] = json.loads(value)
        except ValueError:
            options[name] = value
    return options


def make(name: str, options: Mapping[str, Any]) -> Any:
    """Return a Gymnasium environment that renders pictures, if it can.

    Args:
        name: `CarRacing-v3`, `module:CarRacing-v3` for one that a module registers, or
            `module:Class` for one that is not registered.
        options: For its maker.

    Raises:
        ConfigurationError: If there is no such environment; says what Gymnasium says.
        MissingExtraError: If Gymnasium is not installed.
    """
    gymnasium = need("gymnasium", "the robot gymnasium", "gymnasium")
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("PYGLET_HEADLESS", "1")  # MiniWorld's library asks for a screen
    module, _, attribute = name.rpartition(":")
    wrong = f"the environment {name!r} cannot be made"
    do = "--env is a name such as CarRacing-v3, or MODULE:NAME for one that another package brings"
    with told_as(ConfigurationError, wrong, Exception, do=do):  # it is other people's code
        made = getattr(importlib.import_module(module), attribute, None) if module else None
        maker = made or partial(gymnasium.make, name)
        return maker(**{"render_mode": "rgb_array", **options})


class Environment:
    """An environment as a world to drive in, and the `game` under way. Time passes only by `step`.

    Args:
        picture: `observed`, `rendered`, or `auto`: observed if 160x120 or more.
        seed: Of the first game; each further game has the next.
    """

    def __init__(self, name: str, options: Mapping[str, Any], picture: str, seed: int) -> None:
        self.name = name
        self.env = make(name, options)
        self._picture = picture
        self._seed = seed
        self._seen: Any = None
        self.game = Game(number=0, score=0.0, reward=0.0, is_over=False)

    def reset(self) -> None:
        before = self.game.number
        self._seen, _ = self.env.reset(seed=self._seed + before)
        self.game = Game(number=before + 1, score=0.0, reward=0.0, is_over=False)

    def step(self, action: Any) -> None:
        """Act once; after the end of a game this does nothing."""
        if self.game.is_over:
            return
        self._seen, given, is_terminated, is_truncated, _ = self.env.step(action)
        reward = float(np.nan_to_num(given))
        self.game = Game(
            number=self.game.number,
            score=self.game.score + reward,
            reward=reward,
            is_over=bool(is_terminated or is_truncated),
        )

    def picture(self) -> Pixels:
        """Return what there is to see, RGB, shape (height, width, 3); CameraError if the
        environment gives no picture."""
        found = None if self._picture == "rendered" else _picture_in(self._seen)
        is_small = found is None or found.shape[0] < 120 or found.shape[1] < 160
        if is_small and self._picture != "observed":
            rendered = _picture_in(self.env.render())
            found = found if rendered is None else rendered
        if found is None:
            raise CameraError(
                f"the environment {self.name!r} gives no pictures in this way; try another "
                f"--env-picture ({', '.join(PICTURES)})"
            )
        return found

    def close(self) -> None:
        self.env.close()


def _picture_in(seen: Any) -> Pixels | None:
    """Return the picture that an observation is, or that is among its parts."""
    if isinstance(seen, Mapping):
        return next(
            (found for part in seen.values() if (found := _picture_in(part)) is not None), None
        )
    array = np.asarray(seen)
    if array.dtype != np.uint8 or array.ndim not in (2, 3) or min(array.shape[:2]) < 16:
        return None
    if array.ndim == 2:
        array = array[:, :, None]
    if array.shape[2] not in (1, 3):
        return None
    return np.ascontiguousarray(np.broadcast_to(array, (*array.shape[:2], 3)))


def is_car_racing(name: str) -> bool:
    return name.split(":")[-1].startswith("CarRacing")


def moves_of(name: str, env: Any, table: str = "") -> dict[Move, Any]:
    """Return each move with the action that the environment is given for it, in their order.

    `table` is a person's own, as `left=-0.6,0,0; right=0.6,0,0`; empty: the environment's names.

    Raises:
        ConfigurationError: If the table cannot be read or does not fit, or there are no names.
    """
    space = env.action_space
    is_discrete = hasattr(space, "n") and np.ndim(space.n) == 0 and not space.shape
    if not table and is_car_racing(name):
        table = _CAR_RACING[is_discrete]
    if table:
        actions = _read(table, space)
    elif is_discrete:
        actions = _named(env, int(space.start), int(space.n))
    else:
        raise ConfigurationError(f"the actions of {name} are {space}: {_HELP}")
    if len(actions) < 2:
        raise ConfigurationError(f"{name} needs two moves or more: {_HELP}")
    return {_describe(move): action for move, action in actions.items()}


def steering_of(table: Mapping[Move, Any], space: Any) -> Callable[[Point], Any] | None:
    """Return what tells the action for a point, in a box of fractions; None for other spaces.

    Steering leads from the move ahead to the turns, throttle from what coasts to the moves ahead
    and back. None, too, if the table has no move ahead, or no turn to either side.
    """
    known = {
        (side_of(move.point.steering), side_of(move.point.throttle, 0.0)): np.asarray(action, float)
        for move, action in reversed(list(table.items()))  # the first of those alike
        if move.point is not None
    }
    is_box = bool(space.shape) and np.issubdtype(space.dtype, np.floating)
    if not is_box or not {(0, 1), (-1, 1), (1, 1)} <= set(known):
        return None
    ahead = known[0, 1]
    coast = known.get((0, 0), np.zeros(space.shape))
    back = known.get((0, -1), coast)

    def action_at(point: Point) -> Any:
        way, side = side_of(point.throttle, 0.0), side_of(point.steering, 0.0)
        turn = known[side, 1] - ahead
        drive = (back if way < 0 else ahead) - coast
        action = coast + abs(point.steering) * turn + abs(point.throttle) / USUAL_THROTTLE * drive
        return np.clip(action, space.low, space.high).astype(space.dtype)

    return action_at


def _read(table: str, space: Any) -> dict[Action, Any]:
    actions: dict[Action, Any] = {}
    for part in filter(None, (part.strip() for part in table.split(";"))):
        name, _, numbers = part.partition("=")
        bad = f"--env-moves: {part!r}"
        with told_as(ConfigurationError, f"{bad} is unclear", ValueError, OverflowError, do=_HELP):
            move = Action(name.strip())
            values = [float(number) for number in numbers.split(",")]
            action: Any = np.asarray(values, dtype=space.dtype)
        if not space.shape:
            action = int(values[0]) if values[0].is_integer() and len(values) == 1 else None
        if action is None or not space.contains(action) or move is Action.STOP or move in actions:
            raise ConfigurationError(f"{bad} is no action of {space}; {_HELP}")
        actions[move] = action
    return actions


def _named(env: Any, start: int, n: int) -> dict[Action, Any]:
    """Return the numbered actions by the names that Atari and MiniWorld have for theirs."""
    inner = env.unwrapped
    names: list[str] = [f"move_{i}" for i in range(start, start + n)]
    if callable(getattr(inner, "get_action_meanings", None)):
        names = [str(meaning) for meaning in inner.get_action_meanings()]
    elif isinstance(
        members := getattr(getattr(inner, "actions", None), "__members__", None), Mapping
    ):
        for word, number in members.items():
            if start <= int(number) < start + n:
                names[int(number) - start] = word
    return {_as_action(word): start + i for i, word in enumerate(names[:n])}


def _as_action(word: str) -> Action:
    name = re.sub(r"[^a-z0-9]+", "_", word.lower()).strip("_")
    name = re.sub(r"^(turn|move)_(?=[a-z])", "", name)
    name = {"up": "forward", "back": "backward", "stop": "noop"}.get(name, name)
    return Action(name[:32] if name[:1].isalpha() else f"move_{name}"[:32])


def _describe(name: Action) -> Move:
    side = sum(value for word, value in _SIDES.items() if word in name)
    throttle = -0.5 if any(word in name for word in _BACK) else 0.5 * (name not in _STANDING)
    label = name.replace("_", " ").capitalize()[:24]
    return Move(name, label, steering=side, throttle=throttle)
