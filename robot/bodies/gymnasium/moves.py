"""Which moves an environment has, and what it is given for each: from its own names, or a table."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from robot.devices.wheels import USUAL_THROTTLE
from robot.driver import Move, side_of
from robot.errors import ConfigurationError
from robot.types import Action, Point

_TABLES = {
    "CarRacing": (
        "left=-0.6,0.1,0; right=0.6,0.1,0; forward=0,0.3,0; brake=0,0,0.5; coast=0,0,0",
        "left=2; right=1; forward=3; brake=4; coast=0",
    )
}
"""Tables for the continuous and the discrete form of environments whose moves have no names."""
_SIDES = {"left": -1.0, "right": 1.0}
"""Steering of moves with such a word in their names: on the page they stand on that side."""
_STANDING = ("noop", "coast", "nothing", "stop")
_BACK = ("back", "down", "brake")
_HELP = (
    "name its moves with --env-moves, such as 'left=-0.6,0,0; right=0.6,0,0; forward=0,0.3,0' "
    "(numbers for each move), or 'left=0; right=1' for one that numbers its actions"
)


def moves_of(name: str, env: Any, table: str = "") -> dict[Move, Any]:
    """Return each move with the action that the environment is given for it, in their order.

    `table` is a person's own, as `left=-0.6,0,0; right=0.6,0,0`; empty: the environment's names.

    Raises:
        ConfigurationError: If the table cannot be read or does not fit, or there are no names.
    """
    space = env.action_space
    is_discrete = hasattr(space, "n") and np.ndim(space.n) == 0 and not space.shape
    if not table:
        known = [pair for start, pair in _TABLES.items() if name.split(":")[-1].startswith(start)]
        if known:
            table = known[0][is_discrete]
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
        try:
            move = Action(name.strip())
            values = [float(number) for number in numbers.split(",")]
            action: Any = np.asarray(values, dtype=space.dtype)
        except (ValueError, OverflowError) as error:
            raise ConfigurationError(f"--env-moves: {part!r} cannot be read; {_HELP}") from error
        if not space.shape:
            action = int(values[0]) if values[0].is_integer() and len(values) == 1 else None
        if action is None or not space.contains(action) or move is Action.STOP or move in actions:
            raise ConfigurationError(f"--env-moves: {part!r} is no action of {space}; {_HELP}")
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
