"""A fake policy without computation: it always proposes the first label that it learned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robot.learner.base import State, Vector
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.types import DEFAULT_MOVES, Action, Frame, Point, Prediction

_NOTHING = np.zeros(1, np.uint8)


class FakePolicy(Policy):
    """Proposes moves without looking at the pixels, for tests of the gate, the loop, the link or
    the server.

    Attributes:
        first: The first label that was learned.
        point: The steering and throttle of the first example.
    """

    def __init__(self) -> None:
        real = make_policy("published-1")
        super().__init__("fake-1", 1, real.learner, real.features, moves=DEFAULT_MOVES)
        self.first: Action | None = None
        self.point: Point | None = None

    def extract(self, frame: Frame) -> Vector:
        return _NOTHING

    def propose(self, frame_id: int, x: Vector, **context: Any) -> Prediction:
        shares = {} if self.first is None else {self.first: 1.0}
        return Prediction(
            frame_id=frame_id,
            action=self.first,
            confidence=1.0,
            probabilities=shares,
            point=self.point,
        )

    def learn_all(
        self, examples: Sequence[tuple[Vector, Action, float | None, Point | None]]
    ) -> None:
        if self.first is None and examples:
            _, self.first, _, self.point = examples[0]
        self.n_seen += len(examples)

    def get_state(self) -> State:
        return State(kind="fake", params={"first": self.first, "lessons": self.n_seen})

    def set_state(self, state: State) -> None:
        self.first, self.n_seen = state.params["first"], state.params["lessons"]
