"""Learners that a person might write, and that fail."""

from __future__ import annotations

import os
from typing import Any

from robot.learner.base import BaseLearner, Evidence, State


class NotPicklableError(Exception):
    """An error that pickle cannot restore: the constructor needs two arguments, but gets one."""

    def __init__(self, one: str, two: int) -> None:
        super().__init__(one)


class Odd(BaseLearner):
    """A learner whose error cannot be unpickled in another process."""

    def learn_one(self, x: Any, y: Any) -> None:
        raise NotPicklableError("odd", 2)

    def explain_one(self, x: Any) -> Evidence:
        return Evidence(label="forward", probabilities={"forward": 1.0}, confidence=1.0)

    def get_state(self) -> State:
        return State(kind="straight", params={})

    def set_state(self, state: State) -> None:
        pass


class Deadly(Odd):
    """A learner that ends its process."""

    def learn_one(self, x: Any, y: Any) -> None:
        os._exit(3)


class Teaching(Odd):
    """A learner that cannot be taught."""

    def learn_one(self, x: Any, y: Any) -> None:
        raise ValueError("this learner cannot learn")


class Driving(Odd):
    """A learner that cannot drive."""

    def learn_one(self, x: Any, y: Any) -> None:
        pass

    def explain_one(self, x: Any) -> Evidence:
        raise ValueError("this learner cannot propose a move")
