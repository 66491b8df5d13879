"""Which moves are turns, and which drive straight: from what they do, never from their names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from robot.driver import Move, describe
from robot.types import Action

_STRAIGHT_STEERING = 0.2
"""A move that steers no more than this drives straight."""


class MoveKinds:
    """The moves of a body by what they do; a move that nobody described is of no kind.

    The parts of a policy share one of these, so that all know it when the body's moves are
    described.

    Args:
        moves: The moves. The classic ones are known by name.
        declared: What the driver says of its own (`robot.driver.Move`).

    Attributes:
        turns: The moves that steer to one side, and which: -1 for left, 1 for right.
        straight: The moves that drive ahead or back without steering.
    """

    def __init__(self, moves: Iterable[Action], declared: Iterable[Move] = ()) -> None:
        self._moves = tuple(moves)
        self.describe(declared)

    def describe(self, declared: Iterable[Move]) -> None:
        """Sort the moves by their declared steering and throttle (`robot.driver.Move`)."""
        known = [(move.name, move.point) for move in describe(self._moves, declared)]
        points = {name: point for name, point in known if point is not None}
        self.turns: dict[Action, int] = {
            name: 1 if steering > 0.0 else -1
            for name, (steering, _) in points.items()
            if abs(steering) > _STRAIGHT_STEERING
        }
        self.straight = frozenset(
            name
            for name, (_, throttle) in points.items()
            if name not in self.turns and throttle != 0.0
        )

    def get_state(self) -> dict[str, list[str]]:
        """Return all of it as plain values: what was learned rests on it."""
        left, right = (
            sorted(str(name) for name, own in self.turns.items() if own == side) for side in (-1, 1)
        )
        return {"left": left, "right": right, "straight": sorted(map(str, self.straight))}

    def set_state(self, values: Mapping[str, list[str]]) -> None:
        """Restore what `get_state` returned.

        Raises:
            ValueError: If it does not belong to these moves.
        """
        left, right, straight = (values[key] for key in ("left", "right", "straight"))
        is_plain = all(isinstance(names, list) for names in (left, right, straight))
        named = [*left, *right, *straight] if is_plain else [None]
        if len(values) != 3 or len(set(named)) != len(named) or not set(named) <= set(self._moves):
            raise ValueError("the kinds of moves are not those of its moves")
        self.turns = {Action(name): side for side, own in ((-1, left), (1, right)) for name in own}
        self.straight = frozenset(map(Action, straight))
