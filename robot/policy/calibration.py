"""How sure a learner may be in this place: learned from the examples, before each is learned.

Most examples are like the ones just before them, so that a learner foresees nearly all of them,
whatever the place. Only where the pilot changes the move is an example as hard as a view
of another day. From how well the votes foresaw those examples follows the power (a temperature,
Guo et al. 2017) that turns votes into chances here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from robot.learner.base import Vector
from robot.learner.part import Value
from robot.learner.values import many, name, number, optional, table
from robot.policy.action_filter import USUAL_STEP_S, VOTES_KEPT
from robot.policy.part import Lesson, PolicyPart, Seen
from robot.policy.pilot_pace import PAUSE_S
from robot.types import Action

CHANGE_S = 0.5
"""Examples so long after a change of move count, but none after a pause: a correction begins where
the robot was wrong, which is no sample."""
POWERS = np.geomspace(0.5, 4.0, 13)
"""Powers of the votes that are compared."""
_PRIOR = 20.0
"""The power 1 at changes of move is as credible as so many examples make it."""
_MEMORY = 400.0
"""Old examples count less: after so many more, a third."""
_TRAVELS = 0.4
"""How much of the (logarithmic) difference between places at changes of move is there at all other
views, too: by leave-one-place-out on recorded footage, flat from 0.3 to 0.5."""
_LEAST = 1e-3

_LOGS = np.log(POWERS)
_DOUBT = _PRIOR * _LOGS**2


class Calibration(PolicyPart):
    """Estimates by how much the power differs from the usual one. Constant time an example.

    Args:
        predict: Returns the learner's votes on a view, as it is; none before it has learned.

    Attributes:
        factor: What to multiply the usual power by.
    """

    fields = (
        Value("losses", many(number(0.0), POWERS.size, POWERS.size)),
        Value("label", optional(name)),
        Value("last_s", number()),
        Value("left_s", number()),
        Value("average", table(name, number(0.0))),
    )

    def __init__(self, predict: Callable[[Vector], Mapping[str, float]] = lambda x: {}) -> None:
        self.factor = 1.0
        self._predict = predict
        self._losses = np.zeros(POWERS.size)
        self._label: Action | None = None
        self._last_s = 0.0
        self._left_s = 0.0
        self._average: dict[str, float] = {}
        self._weigh()

    def on_frame(self, seen: Seen) -> None:
        seen.certainty = self.factor

    def on_example(self, lesson: Lesson) -> None:
        if lesson.is_learned:
            self.note(lesson.label, lesson.at_s, lambda: self._predict(lesson.x))

    def note(
        self, label: Action, at_s: float | None, predict: Callable[[], Mapping[str, float]]
    ) -> None:
        """Process one example; call it before the example is learned.

        Args:
            label: Its label.
            at_s: Its teaching time; None: a tenth of a second after the last.
            predict: Returns the learner's votes on it; called only where they count.
        """
        at_s = self._last_s + USUAL_STEP_S if at_s is None else at_s
        step_s, self._last_s = at_s - self._last_s, at_s
        before, self._label = self._label, label
        if before is None or not 0.0 <= step_s < PAUSE_S:
            self._left_s = 0.0
        elif label is not before:
            self._left_s, self._average = CHANGE_S, {}
        else:
            self._left_s -= step_s
        if self._left_s > 1e-9:
            self._count(label, predict())

    def _count(self, label: Action, votes: Mapping[str, float]) -> None:
        if label not in votes:
            return  # a new move: no vote could be for it
        old = self._average or votes
        self._average = {
            str(move): VOTES_KEPT * old.get(move, 0.0) + (1.0 - VOTES_KEPT) * share
            for move, share in votes.items()
        }
        shares = np.maximum(list(self._average.values()), _LEAST)
        powers = shares[:, None] ** POWERS
        chances = powers[list(self._average).index(str(label))] / powers.sum(axis=0)
        self._losses *= 1.0 - 1.0 / _MEMORY
        self._losses -= np.log(np.maximum(chances, _LEAST))
        self._weigh()

    def _weigh(self) -> None:
        """Take the mean of the powers' logarithms, each weighted by how well it foresaw."""
        losses = self._losses + _DOUBT
        weights = np.exp(losses.min() - losses)
        self.factor = math.exp(_TRAVELS * float(weights @ _LOGS) / float(weights.sum()))

    def restored(self) -> None:
        self._losses = np.array(self._losses)
        self._average = {str(move): share for move, share in self._average.items()}
        self._weigh()
