"""Asks the learner about a frame: votes for the moves, and how far to steer with a move.

A learned angle is a mean. Where a thing can be passed on either side, the mean leads into the
thing: so the move gives the side, and the angle only how hard to steer. A pilot who steers all or
nothing never steers by the mean: so the angle stays within `BAND` standard deviations of the mean
that was taught with the chosen move. For a pilot who steers all or nothing this band has no width;
for one who steers by degrees it is wide.

Before the first point is taught nothing is kept and nothing is answered.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.driver import side_of
from robot.learner.base import Learner
from robot.learner.clusters import MOST_FRAMES
from robot.learner.part import Array, Value
from robot.learner.values import Names, count, demand, table
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import PolicyPart, Seen, TaughtExample
from robot.types import Action, Point

BAND = 2.5
"""Half the width of the band about a move's mean angle, in standard deviations. From 1 to 4 it
makes no difference on recorded drives. A narrow band cuts off the end of a curve, which would stay
as hard as most of it was."""
_LEAST = 1e-6
"""Votes for a move that was taught: more than for one that never was."""
_FEW = 64


def _node_id(plain: Any, names: Names) -> int:
    digits = str(plain)  # a table in JSON has texts for keys
    demand(digits.isascii() and digits.isdecimal())
    return int(digits[:17])


class Degrees(PolicyPart):
    """Follows how each move was steered. Where the learner learns no angles each means its mean.

    Attributes:
        angle: Running mean of the learner's angles, whatever the move; rivals drive by it.
    """

    fields = (Array("sums", np.float64, ("n_moves", 4), -MOST_FRAMES, MOST_FRAMES, may_miss=True),)

    def __init__(self, learner: Learner, moves: tuple[Action, ...], kinds: MoveKinds) -> None:
        self._learner, self._is_angular = learner, learner.abilities.angles
        self._moves = moves
        self._kinds = kinds
        self.n_moves = len(moves)
        self._sums: NDArray[np.float64] | None = None  # examples, steering, its square, throttle
        self.angle: float | None = None
        self._steering: float | None = None  # the running average

    def angle_of(self, lesson: TaughtExample) -> float | None:
        """Return the angle that the learner is to learn with an example; None if it learns none."""
        if not self._is_angular or (self._sums is None and lesson.point is None):
            return None
        points = self._kinds.points
        if self._sums is None:
            self._learner.begin_angles({move: point.steering for move, point in points.items()})
        return (lesson.point or points.get(lesson.label, Point(0.0, 0.0))).steering

    def note(self, lesson: TaughtExample) -> None:
        """Take note of how an example was steered that the learner has learned."""
        if lesson.point is not None:
            if self._sums is None:
                self._sums = np.zeros((self.n_moves, 4))
            steering, throttle = lesson.point
            row = self._moves.index(lesson.label)
            self._sums[row] += 1.0, steering, steering * steering, throttle

    def on_frame(self, seen: Seen) -> None:
        usual = self.usual(seen.action) if seen.by_degrees else None
        if usual is None:
            return
        steering, evidence = usual.steering, seen.evidence
        if evidence.angle is not None and evidence.size is not None:
            angle, size = min(max(evidence.angle, -1.0), 1.0), min(max(evidence.size, 0.0), 1.0)
            last = angle if self.angle is None else self.angle
            self.angle = angle + seen.kept * (last - angle)
            side = side_of(steering)
            angle = side * size if side else min(max(angle, -size), size)
            if self._steering is not None:
                angle += seen.kept * (self._steering - angle)
            width = BAND * self._deviation(seen.action)
            steering = self._steering = min(max(angle, steering - width), steering + width)
            if seen.bumped and side:  # a curve that leads into something: turn as the body can
                steering = float(side)
        seen.point = Point(min(max(steering, -1.0), 1.0), usual.throttle)
        seen.spread = seen.evidence.spread

    def usual(self, move: Action) -> Point | None:
        """Return the mean of what was taught with a move, else what the body says of it.

        None before anything was taught by degrees, and if nobody knows.
        """
        if self._sums is None:
            return None
        n, steering, _, throttle = self._sums[self._moves.index(move)].tolist()
        return Point(steering / n, throttle / n) if n else self._kinds.points.get(move)

    def _deviation(self, move: Action) -> float:
        assert self._sums is not None
        n, steering, square, _ = self._sums[self._moves.index(move)].tolist()
        return math.sqrt(max(square / n - (steering / n) ** 2, 0.0)) if n else 0.0

    def reset(self) -> None:
        self.angle = self._steering = None

    def faults(self) -> Iterator[str]:
        if self._sums is not None and (np.abs(self._sums[:, 1:]) > self._sums[:, :1]).any():
            yield "its moves were steered further than any body can"


class Recognition(PolicyPart):
    """The learner among the parts of a policy.

    Attributes:
        used: Which proposal matched an image last, by the image's id.
        taught: The same of examples.
    """

    fields = (Value("last_taught", table(_node_id, count()), "taught"),)

    def __init__(self, learner: Learner, moves: tuple[Action, ...], degrees: Degrees) -> None:
        self._learner = learner
        self._moves = moves
        self._degrees = degrees
        self.used: dict[int, int] = {}
        self.taught: dict[int, int] = {}

    def on_frame(self, seen: Seen) -> None:
        if seen.context is None:
            seen.evidence = self._learner.explain_one(seen.x)
        else:
            seen.evidence = self._learner.explain_in(seen.x, seen.context)
        known = seen.evidence.probabilities
        seen.shares = {
            move: max(known[move], _LEAST) if move in known else 0.0 for move in self._moves
        }
        self._note(self.used, seen.evidence.node, seen.number)

    def on_example(self, lesson: TaughtExample) -> None:
        if lesson.is_learned:
            angle = self._degrees.angle_of(lesson)
            if angle is None and not lesson.contexts:
                self._learner.learn_one(lesson.x, lesson.label)
            else:
                self._learner.learn_in(lesson.x, lesson.label, lesson.contexts, angle)
            self._degrees.note(lesson)
            self._note(self.taught, self._learner.last_node_, lesson.number)

    def reset(self) -> None:
        self._learner.reset()

    def _note(self, when: dict[int, int], node_id: int | None, now: int) -> None:
        if node_id is None:
            return
        when[node_id] = now
        if len(when) > _FEW and len(when) > 4 * self._learner.n_nodes_ + _FEW:
            alive = {node.id for node in self._learner.nodes()}  # most of these nodes are gone
            for gone in [node for node in when if node not in alive]:
                del when[gone]

    def restored(self) -> None:
        self.used = {}
