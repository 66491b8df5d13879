"""Compares the states of learners."""

from __future__ import annotations

from robot.learner.base import State
from robot.store.models.model import same_nodes


def same_state(one: State, two: State) -> bool:
    """True if the complete states of two learners are equal, bit for bit, not only their images."""
    return one.params == two.params and same_nodes(one, two)
