"""What a driver says of its moves: name, label, icon, meaning, steering and throttle.

A move is a name (`robot.types.Action`). What pages, exports and recordings show of it is declared
here, once, beside the driver's code. The six classic moves are known by name alone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from robot.types import Action

_LONGEST_LABEL, _LONGEST_ICON, _LONGEST_MEANING = 24, 16, 200
Point = tuple[float, float]
"""Steering and throttle, as `Move` has them."""


@dataclass(frozen=True, slots=True)
class Move:
    """One move of a body.

    Args:
        name: A lower-case word, as `fast` or `left_2`; it is what recordings and models keep.
        label: What a button says: one text for all, or texts by language (`en`, `es`, `zh`);
            English stands in for a language that is missing. Empty: made of the name.
        icon: A classic move's name, for its arrow, or a sign or two such as "⏩". Empty: the arrow
            of its own name, if there is one.
        does: What the body does then, in a sentence.
        steering: From -1 (full left) to 1 (full right), for bodies that are steered.
        throttle: From -1 (full speed backward) to 1 (full speed ahead). Both or neither.

    Raises:
        ValueError: If a field is out of range; says which.
    """

    name: Action
    label: str | Mapping[str, str] = field(default="", hash=False)
    icon: str = ""
    does: str = ""
    steering: float | None = field(default=None, kw_only=True)
    throttle: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", Action(self.name))
        if self.name is Action.STOP:
            raise ValueError("'stop' is no move: every body stops")
        if any(not text or len(text) > _LONGEST_LABEL for text in self.labels.values()):
            raise ValueError(f"the label of {self.name!r} must have 1 to {_LONGEST_LABEL} letters")
        if len(self.icon) > _LONGEST_ICON or len(self.does) > _LONGEST_MEANING:
            raise ValueError(f"the icon or the meaning of {self.name!r} is too long")
        if (self.steering is None) != (self.throttle is None):
            raise ValueError(f"{self.name!r} needs both steering and throttle, or neither")
        for number in (self.steering, self.throttle):
            if number is not None and not (math.isfinite(number) and -1.0 <= number <= 1.0):
                raise ValueError(f"steering and throttle of {self.name!r} must lie in [-1, 1]")

    @property
    def labels(self) -> dict[str, str]:
        """The label by language; English is always among them unless the page has its own."""
        if isinstance(self.label, str):
            return {"en": self.label} if self.label else {}
        return dict(self.label)

    @property
    def point(self) -> Point | None:
        """Steering and throttle; None for a move that is no point in that plane."""
        if self.steering is None or self.throttle is None:
            return None
        return self.steering, self.throttle

    def describe(self) -> dict[str, Any]:
        """Return plain values, for a page or a file."""
        return {
            "name": str(self.name),
            "label": self.labels,
            "icon": self.icon,
            "does": self.does,
            "steering": self.steering,
            "throttle": self.throttle,
        }


CLASSIC: dict[Action, Move] = {
    move.name: move
    for move in (
        Move(Action.FORWARD, does="drives straight ahead", steering=0.0, throttle=0.5),
        Move(Action.LEFT, does="turns left about its left wheel", steering=-1.0, throttle=0.5),
        Move(Action.RIGHT, does="turns right about its right wheel", steering=1.0, throttle=0.5),
        Move(Action.BACKWARD, does="drives straight back", steering=0.0, throttle=-0.5),
        Move(Action.SPIN_LEFT, does="spins left on the spot", steering=-1.0, throttle=0.0),
        Move(Action.SPIN_RIGHT, does="spins right on the spot", steering=1.0, throttle=0.0),
    )
}
"""The moves of a body with two wheels. The page has labels and arrows for them in its languages."""


def names(moves: Iterable[Move]) -> tuple[Action, ...]:
    """Return the names, in their order."""
    return tuple(move.name for move in moves)


def describe(wanted: Iterable[Action], declared: Iterable[Move] = ()) -> tuple[Move, ...]:
    """Return what is known of each move: as it was declared, or the classic one, or its name."""
    known = {**CLASSIC, **{move.name: move for move in declared}}
    return tuple(known.get(name) or Move(name) for name in wanted)


def point_of(name: Action, declared: Iterable[Move] = ()) -> Point | None:
    """Return the steering and throttle of a move, and of STOP; None if nobody declared them."""
    return (0.0, 0.0) if name is Action.STOP else describe([name], declared)[0].point


def to_text(moves: Iterable[Move]) -> str:
    """Write moves as JSON, for the metadata of a recording."""
    return json.dumps([move.describe() for move in moves], ensure_ascii=False)


def from_text(text: str) -> tuple[Move, ...]:
    """Read what `to_text` wrote; an empty text is none.

    Raises:
        ValueError: If it is anything else.
    """
    if not text:
        return ()
    try:
        return tuple(
            Move(
                Action(plain["name"]),
                {str(code): str(words) for code, words in plain["label"].items()},
                str(plain["icon"]),
                str(plain["does"]),
                steering=plain["steering"],
                throttle=plain["throttle"],
            )
            for plain in json.loads(text)
        )
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"the moves are described in another form: {error}") from error
