"""The moves of a body: their names, buttons, steering and throttle.

A move is a name (`robot.types.Action`). The description of a move for pages, exports and recordings
is declared once, in the driver's code. The six classic moves need only their names.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from robot.types import Action, Point

_LONGEST_LABEL, _LONGEST_ICON, _LONGEST_MEANING = 24, 16, 200
TURNS_BEYOND = 0.2
"""A move or point drives straight if its steering is at most this share of full lock."""


@dataclass(frozen=True, slots=True)
class Move:
    """One move of a body.

    Args:
        name: A lower-case word such as `fast` or `left_2`; recordings and models store this name.
        label: The button's text: one text, or texts by language (`en`, `es`, `zh`). If a language
            is missing, the page shows the English text; if `label` is empty, the page makes a text
            from the name.
        icon: The name of a classic move, to show its arrow, or one or two characters such as
            "⏩". If empty, a move with a classic name gets that move's arrow.
        does: The body's motion in this move, as a sentence.
        steering: From -1 (full left) to 1 (full right), for bodies that are steered.
        throttle: From -1 (full speed backward) to 1 (full speed ahead). Give both steering and
            throttle, or neither.

    Raises:
        ValueError: If a field is out of range; the message names the field.

    Example:
        >>> drift = Move("drift", icon="↪", does="slides to the left", steering=-0.7, throttle=0.9)
        >>> drift.point
        Point(steering=-0.7, throttle=0.9)
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
            raise ValueError("do not list 'stop' as a move: every robot can stop without it")
        if any(not text or len(text) > _LONGEST_LABEL for text in self.labels.values()):
            raise ValueError(f"the label of {self.name!r} needs 1 to {_LONGEST_LABEL} characters")
        if len(self.icon) > _LONGEST_ICON or len(self.does) > _LONGEST_MEANING:
            raise ValueError(f"the `icon` or `does` of {self.name!r} is too long")
        if (self.steering is None) != (self.throttle is None):
            raise ValueError(f"{self.name!r} needs both steering and throttle, or neither")
        for name in ("steering", "throttle") if self.steering is not None else ():
            object.__setattr__(self, name, float(getattr(self, name)))  # NumPy's numbers, too
            if not -1.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"steering and throttle of {self.name!r} must lie in [-1, 1]")

    @property
    def labels(self) -> dict[str, str]:
        """The label by language, including English. Empty if `label` is empty; the page then uses
        its own labels."""
        if isinstance(self.label, str):
            return {"en": self.label} if self.label else {}
        return dict(self.label)

    @property
    def point(self) -> Point | None:
        """Steering and throttle; None if the move does not define them."""
        if self.steering is None or self.throttle is None:
            return None
        return Point(self.steering, self.throttle)

    def describe(self) -> dict[str, Any]:
        """Return plain values, for a page or a file."""
        return {**asdict(self), "name": str(self.name), "label": self.labels}


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
"""The moves of a body with two wheels. The page has labels and arrows for these moves."""


def names(moves: Iterable[Move]) -> tuple[Action, ...]:
    """Return the names of these moves, in order."""
    return tuple(move.name for move in moves)


def describe(wanted: Iterable[Action], declared: Iterable[Move] = ()) -> tuple[Move, ...]:
    """Return the wanted moves. For a name that the driver does not declare, return the classic move
    of this name; if there is none, a move without a description."""
    known = {**CLASSIC, **{move.name: move for move in declared}}
    return tuple(known.get(name) or Move(name) for name in wanted)


def point_of(name: Action, declared: Iterable[Move] = ()) -> Point | None:
    """Return the steering and throttle of a move or STOP; None if they are not declared."""
    if name is Action.STOP:
        return Point(0.0, 0.0)
    known = next((move for move in declared if move.name == name), CLASSIC.get(name))
    return None if known is None else known.point


def side_of(steering: float, threshold: float = TURNS_BEYOND) -> int:
    """Return the side that this steering turns to: -1 left, 1 right, 0 straight."""
    return (steering > threshold) - (steering < -threshold)


def move_at(point: Point, moves: Iterable[Move], threshold: float = TURNS_BEYOND) -> Action | None:
    """Return the move that is nearest to this steering and throttle. Return None if the point is a
    stop, or if no move drives in the point's direction (ahead, back, or on the spot).

    Return the nearest move that drives in the same direction and turns to the same side. If no such
    move turns to that side, return the nearest move in the same direction, for example `backward`
    for a curve backward.

    Raises:
        ValueError: If steering or throttle is not a number in [-1, 1].
    """
    if not all(-1.0 <= number <= 1.0 for number in point):
        raise ValueError(f"steering and throttle must lie in [-1, 1], not {tuple(point)}")
    side, way = side_of(point.steering, threshold), side_of(point.throttle, 0.0)
    known = [(move.name, at) for move in moves if (at := move.point) is not None]
    ahead = [(name, at) for name, at in known if side_of(at.throttle, 0.0) == way]
    near = [(name, at) for name, at in ahead if side_of(at.steering) == side]
    choice = near or (ahead if way else [])
    return min(choice, key=lambda move: math.dist(move[1], point))[0] if choice else None
