"""The learner among the parts of a policy: what it recognises on a frame, and what it learns."""

from __future__ import annotations

from robot.learner.base import ContextualLearner, Learner
from robot.policy.degrees import Degrees
from robot.policy.part import Lesson, PolicyPart, Seen
from robot.types import Action

_LEAST = 1e-6
"""Votes for a move that was taught: more than for one that never was."""


class Recognition(PolicyPart):
    """The learner among the parts of a policy."""

    def __init__(self, learner: Learner, moves: tuple[Action, ...], degrees: Degrees) -> None:
        self._learner = learner
        self._degrees = degrees
        self._moves = moves

    def on_frame(self, seen: Seen) -> None:
        seen.evidence = self._learner.explain_one(seen.x)
        self._share_out(seen)

    def on_example(self, lesson: Lesson) -> None:
        if lesson.is_learned and not self._degrees.learn(lesson):
            self._learn(lesson)

    def _learn(self, lesson: Lesson) -> None:
        self._learner.learn_one(lesson.x, lesson.label)

    def reset(self) -> None:
        self._learner.reset()

    def _share_out(self, seen: Seen) -> None:
        known = seen.evidence.probabilities
        seen.shares = {
            move: max(known[move], _LEAST) if move in known else 0.0 for move in self._moves
        }


class ContextualRecognition(Recognition):
    """A learner to which the move under way matters."""

    _learner: ContextualLearner

    def on_frame(self, seen: Seen) -> None:
        seen.evidence = self._learner.explain_in(seen.x, seen.context)
        self._share_out(seen)

    def _learn(self, lesson: Lesson) -> None:
        self._learner.learn_in(lesson.x, lesson.label, lesson.contexts)
