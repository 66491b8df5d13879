"""Converts any action space to a list of numbers, and the numbers to moves.

An action of a nested space is the list of all its numbers, in the order of the space's parts. A
table of moves uses the same order. Without a table, each choice of a `Discrete` space is a move; in
other spaces, each move changes one number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robot.bodies.gymnasium.action_names import names_of
from robot.devkit.wheels import USUAL_THROTTLE
from robot.errors import ConfigurationError
from robot.moves import Move, side_of
from robot.types import Action, Point

_MOST_NUMBERS = 64
"""Maximum number of numbers in one action, so that a person can write them in a table."""
_MOST_MOVES = 32
"""Maximum number of moves in a model."""
_NO_BOUND = 1e6
"""Magnitude above which a bound of a space means "no bound"."""
_LONGEST_NAME, _LONGEST_LABEL = 32, 24
_CAR_RACING = (
    "left=-0.6,0.1,0; right=0.6,0.1,0; forward=0,0.3,0; brake=0,0,0.5; coast=0,0,0",
    "left=2; right=1; forward=3; brake=4; coast=0",
)
"""Tables for the continuous and the discrete form of CarRacing, whose moves have no names."""
_SIDES = {"left": -1.0, "right": 1.0}
"""Maps words in the name of a move to the move's steering. The page shows a move on the side to
which it steers."""
_STANDING = ("noop", "no_op", "idle", "rest", "coast", "nothing", "do_nothing", "stop", "wait")
_BACK = ("back", "down", "brake", "slower", "reverse")


@dataclass(frozen=True, slots=True)
class Number:
    """One number of an action: its name, and its bounds, which may be infinite."""

    name: str
    least: float
    most: float
    is_whole: bool

    @property
    def rest(self) -> float:
        """The allowed value nearest to 0. If each number has this value, the robot stands still,
        or nearly so."""
        return min(max(0.0, self.least), self.most)

    @property
    def others(self) -> list[tuple[str, float]]:
        """The moves that change this number, each as its name and the number's new value."""
        if self.is_whole and (self.least, self.most) == (0.0, 1.0):
            return [(self.name, 1.0)]
        if self.is_whole and self.most - self.least <= _MOST_MOVES:
            values = [self.least + i for i in range(int(self.most - self.least) + 1)]
            named = [(f"{self.name}_{_in_words(int(value))}", value) for value in values]
        else:
            minus = self.least if math.isfinite(self.least) else self.rest - 1.0
            plus = self.most if math.isfinite(self.most) else self.rest + 1.0
            named = [(f"{self.name}_minus", minus), (f"{self.name}_plus", plus)]
        return [(name, value) for name, value in named if value != self.rest]

    def accepts(self, value: float) -> bool:
        return self.least <= value <= self.most and (not self.is_whole or value.is_integer())

    def __str__(self) -> str:
        kind = "whole, " if self.is_whole else ""
        return f"{self.name} ({kind}{self.least:g} to {self.most:g})"


class ActionForm:
    """Describes each action of an action space as a list of numbers.

    Attributes:
        numbers: The numbers of an action, in the order of the space's parts.
        is_one_choice: True if an action is a single number, which chooses among numbered actions.
        is_buttons: True if an action is a list of buttons, each pressed or not.

    Raises:
        ConfigurationError: If an action contains something that is not a number, or too many
            numbers.
    """

    def __init__(self, space: Any, name: str) -> None:
        self._space = space
        self.numbers = tuple(_numbers_in(space, "", name))
        self.is_one_choice = _kind_of(space) == "Discrete"
        self.is_buttons = _kind_of(space) == "MultiBinary"

    @property
    def n_choices(self) -> int:
        """The number of actions to choose from; 0 unless an action is one choice among numbered
        actions."""
        number = self.numbers[0]
        return int(number.most - number.least) + 1 if self.is_one_choice else 0

    def action(self, values: Sequence[float]) -> Any:
        """Return the environment's action for these numbers."""
        return _action_of(self._space, iter(values))

    def __str__(self) -> str:
        n, told = len(self.numbers), ", ".join(map(str, self.numbers[:8]))
        return f"{n} number{'s' * (n != 1)}: {told}{', ...' * (n > 8)}"


def moves_of(name: str, env: Any, table: str = "") -> dict[Move, Any]:
    """Return the moves in their order, each with its action for the environment.

    `table` is the table of moves that a person gave, for example `left=-0.6,0,0; right=0.6,0,0`. If
    `table` is empty, each choice of a `Discrete` action space is a move. In other action spaces,
    each move changes one number and leaves the others at their `rest` value.

    Raises:
        ConfigurationError: If the table cannot be read, if it does not fit the environment's
            actions, or if there are too few or too many moves.
    """
    form = ActionForm(env.action_space, name)
    if not table and is_car_racing(name):
        table = _CAR_RACING[form.is_one_choice]
    if table:
        chosen = _read(table, form)
    else:
        chosen = list(_named(env, form))
        if len(chosen) > _MOST_MOVES:
            raise ConfigurationError(
                f"{name} has {form.n_choices or len(chosen)} moves, but a model has at most "
                f"{_MOST_MOVES}; {_help(form)}"
            )
    if len(chosen) < 2:
        raise ConfigurationError(f"{name} needs at least two moves; {_help(form)}")
    return {move: form.action(values) for move, values in _distinct(chosen)}


def steering_of(table: Mapping[Move, Any], space: Any) -> Callable[[Point], Any] | None:
    """Return a function that converts a `Point` to an action; None if the action space is not a
    `Box` of floats.

    Steering interpolates between the move ahead and the turns. Throttle interpolates between
    coasting and the moves ahead and back. The result is also None if the table lacks a move ahead,
    a left turn or a right turn.
    """
    if _kind_of(space) != "Box" or not np.issubdtype(space.dtype, np.floating):
        return None
    known = {
        (side_of(move.point.steering), side_of(move.point.throttle, 0.0)): np.asarray(action, float)
        # in reverse order, so that the first of two moves with the same point overwrites the second
        for move, action in reversed(list(table.items()))
        if move.point is not None
    }
    if not {(0, 1), (-1, 1), (1, 1)} <= set(known):
        return None
    ahead = known[0, 1]
    coast = known.get((0, 0), np.zeros(space.shape))
    back = known.get((0, -1), coast)

    def action_at(point: Point) -> Any:
        way, side = side_of(point.throttle, 0.0), side_of(point.steering, 0.0)
        turn = known[side, 1] - ahead
        drive = (back if way < 0 else ahead) - coast
        action = coast + abs(point.steering) * turn + abs(point.throttle) / USUAL_THROTTLE * drive
        return np.asarray(np.clip(action, space.low, space.high), space.dtype)

    return action_at


def is_car_racing(name: str) -> bool:
    return name.split(":")[-1].startswith("CarRacing")


# How actions are sent to the environment ------------------------------------------------------


def _kind_of(space: Any) -> str:
    """Return the kind of a space: the name of its class, the same in Gymnasium and its
    predecessor."""
    names = [base.__name__ for base in type(space).__mro__]
    kinds = ("Discrete", "MultiDiscrete", "MultiBinary", "Box", "Tuple", "Dict")
    return next((name for name in names if name in kinds), type(space).__name__)


def _numbers_in(space: Any, name: str, whose: str) -> Iterator[Number]:
    kind = _kind_of(space)
    if kind in ("Tuple", "Dict"):
        parts = space.spaces.items() if kind == "Dict" else enumerate(space.spaces, 1)
        for key, part in parts:
            yield from _numbers_in(part, f"{name}_{key}".strip("_"), whose)
        return
    if kind == "Discrete":
        start = int(getattr(space, "start", 0))
        yield Number(name or "action", start, start + int(space.n) - 1, is_whole=True)
        return
    if kind == "MultiDiscrete":
        least = np.broadcast_to(getattr(space, "start", 0), np.shape(space.nvec))
        most = least + np.asarray(space.nvec) - 1
    elif kind == "MultiBinary":
        least, most = np.zeros(space.shape), np.ones(space.shape)
    elif kind == "Box":
        least, most = space.low, space.high
    else:
        raise ConfigurationError(
            f"the actions of {whose} are {str(space)[:200]}; this robot can send only numbers, not "
            f"a {kind}"
        )
    if np.size(least) > _MOST_NUMBERS:
        raise ConfigurationError(
            f"an action of {whose} has {np.size(least)} numbers, but the page can control at most "
            f"{_MOST_NUMBERS}; wrap the environment so that its actions have fewer numbers"
        )
    unit = name or ("button" if kind == "MultiBinary" else "axis")
    is_whole = kind != "Box" or not np.issubdtype(space.dtype, np.floating)
    for i, (low, high) in enumerate(zip(np.ravel(least), np.ravel(most), strict=True), 1):
        numbered = f"{unit}_{i}" if np.size(least) > 1 or not name else unit
        yield Number(numbered, _bound(low, -math.inf), _bound(high, math.inf), is_whole=is_whole)


def _bound(value: Any, no_bound: float) -> float:
    return float(value) if abs(float(value)) <= _NO_BOUND else no_bound


def _action_of(space: Any, values: Iterator[float]) -> Any:
    kind = _kind_of(space)
    if kind == "Dict":
        return {key: _action_of(part, values) for key, part in space.spaces.items()}
    if kind == "Tuple":
        return tuple(_action_of(part, values) for part in space.spaces)
    if kind == "Discrete":
        return int(next(values))
    numbers = [next(values) for _ in range(math.prod(space.shape))]
    return np.asarray(numbers, dtype=space.dtype).reshape(space.shape)


# Moves ----------------------------------------------------------------------------------------

_Chosen = list[tuple[str, list[float]]]
"""Moves, each with its name and the numbers of its action."""


def _read(table: str, form: ActionForm) -> _Chosen:
    chosen: _Chosen = []
    for part in filter(None, (part.strip() for part in table.split(";"))):
        name, _, text = part.partition("=")
        bad = f"--env-moves: {part!r}"
        try:
            values = [float(number) for number in text.split(",")]
            move = Action(name.strip())
        except ValueError as error:
            raise ConfigurationError(f"{bad} cannot be read: {error}; {_help(form)}") from error
        if move is Action.STOP or move in {other for other, _ in chosen}:
            why = "every robot can stop" if move is Action.STOP else "the name is used twice"
            raise ConfigurationError(f"{bad} cannot be a move: {why}")
        if len(values) != len(form.numbers):
            count = f"{len(values)} number{'s' * (len(values) != 1)}"
            raise ConfigurationError(f"{bad} has {count}; {_help(form)}")
        for value, number in zip(values, form.numbers, strict=True):
            if not number.accepts(value):
                raise ConfigurationError(f"{bad} is not an action: {value:g} is not {number}")
        chosen.append((move, values))
    return chosen


def _named(env: Any, form: ActionForm) -> Iterator[tuple[str, list[float]]]:
    """Yield the moves of an environment without a table."""
    if form.is_one_choice:
        [number] = form.numbers
        first, n = int(number.least), int(number.most - number.least) + 1
        names = names_of(env, first, n) if n <= 2 * _MOST_MOVES else {}
        for code in range(first, first + min(n, 2 * _MOST_MOVES)):
            yield names.get(code) or f"move_{_in_words(code)}", [float(code)]
        return
    rest = [number.rest for number in form.numbers]
    yield "rest", rest
    buttons = names_of(env, 0, len(rest)) if form.is_buttons else {}
    for i, number in enumerate(form.numbers):
        n_values = number.most - number.least + 1
        has_names = number.is_whole and 2 < n_values <= _MOST_MOVES
        names = names_of(env, int(number.least), int(n_values)) if has_names else {}
        for name, value in number.others:
            called = buttons.get(i) or (names.get(int(value)) if names else None) or name
            yield called, [*rest[:i], value, *rest[i + 1 :]]


def _distinct(chosen: _Chosen) -> Iterator[tuple[Move, list[float]]]:
    """Turn pairs of a name and an action into pairs of a move and an action. If several moves have
    the same name, the second and later ones get a number."""
    taken: set[str] = set()
    for word, values in chosen:
        name, n = _as_action(word), 1
        wanted = name
        while name in taken:
            n += 1
            name = f"{wanted[: _LONGEST_NAME - len(str(n)) - 1]}_{n}"
        taken.add(name)
        yield _describe(name, word if n == 1 else f"{word} {n}"), values


def _as_action(word: str) -> str:
    """Convert an environment's name of an action to the name of a move."""
    name = re.sub(r"[^a-z0-9]+", "_", word.lower()).strip("_")
    name = re.sub(r"^(turn|move)_(?=[a-z])(?!minus_\d)", "", name)
    name = {"up": "forward", "back": "backward", "stop": "noop"}.get(name, name)
    if not name[:1].isalpha():
        name = f"move_{name}" if name else "move"
    return name[:_LONGEST_NAME]


def _in_words(value: int) -> str:
    return f"minus_{-value}" if value < 0 else str(value)


def _describe(name: str, word: str) -> Move:
    side = math.fsum(value for part, value in _SIDES.items() if part in name)
    throttle = -0.5 if any(part in name for part in _BACK) else 0.5 * (name not in _STANDING)
    label = name.replace("_", " ").capitalize()[:_LONGEST_LABEL]
    return Move(Action(name), label, steering=side, throttle=throttle)


def _help(form: ActionForm) -> str:
    rest = [number.rest for number in form.numbers]
    values = [value for _, value in form.numbers[0].others][:2]
    moves = [
        f"{side}={','.join(f'{number:g}' for number in [value, *rest[1:]])}"
        for side, value in zip(("left", "right"), [*values, rest[0], rest[0]], strict=False)
    ]
    return f"an action has {form}. Name the moves, as in --env-moves '{'; '.join(moves)}'"
