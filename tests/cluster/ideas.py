"""Ideas of a person: one that works, and some that fail."""

from __future__ import annotations

import os
from typing import Any

from robot.learner.base import BaseLearner, Evidence, State
from robot.policy.registry import make_policy
from robot.types import DEFAULT_MOVES


class Straight(BaseLearner):
    """A learner that always goes forward."""

    def learn_one(self, x: Any, y: Any) -> None:
        pass

    def explain_one(self, x: Any) -> Evidence:
        return Evidence(label="forward", probabilities={"forward": 1.0}, confidence=1.0)

    def get_state(self) -> State:
        return State(kind="straight", params={})

    def set_state(self, state: State) -> None:
        pass


class Teaching(Straight):
    def learn_one(self, x: Any, y: Any) -> None:
        raise ValueError("nothing can be learned")


class Driving(Straight):
    def explain_one(self, x: Any) -> Evidence:
        raise ValueError("nothing can be said")


class NotPicklableError(Exception):
    """Pickle constructs it again with one argument, but it needs two."""

    def __init__(self, one: str, two: int) -> None:
        super().__init__(one)


class Odd(Straight):
    def learn_one(self, x: Any, y: Any) -> None:
        raise NotPicklableError("odd", 2)


class Deadly(Straight):
    def learn_one(self, x: Any, y: Any) -> None:
        os._exit(3)


def honest() -> Any:
    return make_policy("default-8", DEFAULT_MOVES)
