"""Classifies moves as turns or straight moves, by their steering and throttle."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robot.learner.base import Mirror
from robot.learner.part import Stateful, Value
from robot.learner.values import many, name
from robot.moves import Move, describe, side_of
from robot.types import Action


class MoveKinds(Stateful):
    """The moves of a body, grouped by effect. A move whose steering and throttle are unknown has no
    kind.

    All parts of a policy share one `MoveKinds`, so all parts know the kinds of a body's moves once
    `describe` has been called.

    Args:
        moves: The moves. The kinds of the classic moves are known from their names.

    Attributes:
        turns: The moves that steer to one side, with the side: -1 for left, 1 for right.
        straight: The moves that drive ahead or back without steering.
        others: The moves whose effect is unknown; never STOP.
        measured: The moves during which a policy measures how much the picture usually changes: the
            straight moves, or the others if no move is known to be straight.
        points: Steering and throttle of the moves that declare them; set by the body, never saved.
    """

    fields = tuple(Value(kind, many(name)) for kind in ("left", "right", "straight"))

    def __init__(self, moves: Iterable[Action]) -> None:
        self._moves = tuple(moves)
        self.describe(())

    def describe(self, declared: Iterable[Move]) -> None:
        """Sort the moves by their declared steering and throttle (`robot.moves.Move`)."""
        known = [(move.name, move.point) for move in describe(self._moves, declared)]
        points = self.points = {name: point for name, point in known if point is not None}
        sides = {name: side_of(point.steering) for name, point in points.items()}
        self._left = sorted(name for name, side in sides.items() if side < 0)
        self._right = sorted(name for name, side in sides.items() if side > 0)
        self._straight = sorted(
            name for name, point in points.items() if not sides[name] and point.throttle != 0.0
        )
        self.restored()

    def mirrored(self) -> dict[Action, Action]:
        """Map each turn to the equally sharp turn to the other side, if there is one."""
        points = {(point.steering, point.throttle): Action(n) for n, point in self.points.items()}
        pairs = {
            points[point]: points.get((-point[0], point[1]), points[point]) for point in points
        }
        return {move: other for move, other in pairs.items() if move != other}

    def mirror(self, features: object) -> Mirror | None:
        """Return how mirroring an image changes its vector and its label. Return None if the
        features have no mirror image, or if no turn has an opposite turn."""
        pairs, places = self.mirrored(), getattr(features, "mirror", None)
        if places is None or not pairs:
            return None
        return Mirror(places(), {str(move): str(other) for move, other in pairs.items()})

    def restored(self) -> None:
        sides = ((-1, self._left), (1, self._right))
        self.turns = {Action(name): side for side, own in sides for name in own}
        self.straight = frozenset(map(Action, self._straight))
        known = {*self.turns, *self.straight, Action.STOP}
        self.others = frozenset(move for move in self._moves if move not in known)
        self.measured = self.straight or self.others

    def faults(self) -> Iterator[str]:
        named = [*self._left, *self._right, *self._straight]
        if len(set(named)) < len(named) or not set(named) <= set(self._moves):
            yield "its kinds of moves do not match its moves"
