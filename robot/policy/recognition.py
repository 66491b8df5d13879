"""Adapts a view to the light, gets the learner's votes on it, and computes the steering of a move.

Directions of gradients hardly change with the light, but grey values do. So each view is scaled to
the brightness of the examples (`LightAdaptation`).

A learned angle is a mean over examples. If an obstacle can be passed on either side, the mean leads
into the obstacle. So the move determines the side, and the angle determines only the amount of
steering (`Degrees`). The angle must also lie within `BAND` standard deviations of the mean angle
that the pilot taught with the chosen move. If the pilot always steers either fully or not at all,
the standard deviation is 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Learner, Vector
from robot.learner.clusters import MOST_FRAMES
from robot.learner.part import Array, Value
from robot.learner.values import Names, count, demand, number, table
from robot.moves import side_of
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import PolicyPart, Seen, TaughtExample
from robot.types import Action, Point

BAND = 2.5
"""Half the width of the band around a move's mean angle, in standard deviations. Values from 1 to 4
make no difference on recorded drives. If the band were narrower, the robot could not steer less
sharply at the end of a curve."""
_LEAST = 1e-6
"""Minimum share of the votes of a move that was taught; a move that was never taught gets 0."""
_FEW = 64


def _node_id(plain: Any, names: Names) -> int:
    digits = str(plain)  # the keys of a JSON object are strings
    demand(digits.isascii() and digits.isdecimal())
    return int(digits[:17])


class Degrees(PolicyPart):
    """Records how each move was steered. If the learner learns no angles, each move gets its mean
    steering; without any proportional example, no point is proposed.

    Attributes:
        angle: Running mean of the predicted angles over all moves; some baselines steer by it.
    """

    fields = (
        Array("sums", np.float64, ("n_moves", 4), -MOST_FRAMES, MOST_FRAMES, is_optional=True),
    )

    def __init__(self, learner: Learner, moves: tuple[Action, ...], kinds: MoveKinds) -> None:
        self._learner, self._is_angular = learner, learner.abilities.angles
        self._moves = moves
        self._kinds = kinds
        self.n_moves = len(moves)
        self._sums: NDArray[np.float64] | None = None  # examples, steering, its square, throttle
        self.angle: float | None = None
        self._steering: float | None = None  # the running average of the steering

    def angle_of(self, lesson: TaughtExample) -> float | None:
        """Return the angle to learn with an example; None if the learner learns no angles."""
        if not self._is_angular or (self._sums is None and lesson.point is None):
            return None
        points = self._kinds.points
        if self._sums is None:
            self._learner.begin_angles({move: point.steering for move, point in points.items()})
        return (lesson.point or points.get(lesson.label, Point(0.0, 0.0))).steering

    def note(self, lesson: TaughtExample) -> None:
        """Record the steering of an example that was learned."""
        if lesson.point is not None:
            if self._sums is None:
                self._sums = np.zeros((self.n_moves, 4))
            steering, throttle = lesson.point
            row = self._moves.index(lesson.label)
            self._sums[row] += 1.0, steering, steering * steering, throttle

    def on_frame(self, seen: Seen) -> None:
        usual = self.usual(seen.action) if seen.takes_points else None
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
            if seen.bumped and side:  # the curve hits an obstacle, so turn fully
                steering = float(side)
        seen.point = Point(min(max(steering, -1.0), 1.0), usual.throttle)
        seen.spread = seen.evidence.spread

    def usual(self, move: Action) -> Point | None:
        """Return the mean point taught with a move, else the body's declared point.

        None if no example was taught with proportional steering, or if the body declares no point.
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
            yield "the steering of its moves is outside [-1, 1]"


ANOTHER_LIGHT = 1.5
"""The light counts as changed if the brighter light is at least this many times the darker one.
Smaller differences in brightness come from the view, not from the light."""
SECONDS = 3.0
"""Driving time over which the brightness is averaged, in seconds."""
EXAMPLES = 600.0
"""Number of examples over which the brightness of the examples is averaged."""


class LightAdaptation(PolicyPart):
    """Compares a drive's brightness with that of the examples. A drive's brightness is a mean over
    some seconds, so that a dark corner hardly changes it.

    Args:
        brighten: Returns a view with its grey values multiplied by a factor.
    """

    fields = (Value("taught", number(0.0, 255.0)), Value("examples", number(0.0, EXAMPLES)))

    def __init__(self, brighten: Callable[[Vector, float], Vector]) -> None:
        self._brighten = brighten
        self._taught = self._examples = 0.0
        self._driven: float | None = None

    def on_frame(self, seen: Seen) -> None:
        brightness = _brightness(seen.picture)
        driven = brightness if self._driven is None else self._driven
        driven += (1.0 - math.exp(-seen.step_s / SECONDS)) * (brightness - driven)
        self._driven = driven
        gain = self._taught / max(driven, 1.0)
        if self._examples and not 1.0 / ANOTHER_LIGHT <= gain <= ANOTHER_LIGHT:
            seen.x = self._brighten(seen.x, gain)

    def on_example(self, lesson: TaughtExample) -> None:
        self._examples = min(self._examples + 1.0, EXAMPLES)
        self._taught += (_brightness(lesson.picture) - self._taught) / self._examples

    def reset(self) -> None:
        self._driven = None

    restored = reset


def _brightness(picture: NDArray[np.uint8]) -> float:
    """Return the mean grey value; `mean()` takes twice as long."""
    return float(picture.sum()) / max(picture.size, 1)


class Recognition(PolicyPart):
    """The part of a policy that asks and teaches the learner.

    Attributes:
        used: For each image id the number of the last proposal that matched the image.
        taught: For each image id the number of the last example that matched the image.
    """

    fields = (Value("last_taught", table(_node_id, count()), "taught"),)

    def __init__(self, learner: Learner, moves: tuple[Action, ...], degrees: Degrees) -> None:
        self._learner = learner
        self._moves = moves
        self._degrees = degrees
        self.used: dict[int, int] = {}
        self.taught: dict[int, int] = {}

    def on_frame(self, seen: Seen) -> None:
        if seen.context is None:  # a plugin may override only one of these two methods
            seen.evidence = self._learner.explain_one(seen.x)
        else:
            seen.evidence = self._learner.explain_in(seen.x, seen.context)
        known = seen.evidence.probabilities
        seen.shares = {
            move: max(known[move], _LEAST) if move in known else 0.0 for move in self._moves
        }
        self._note(self.used, seen.evidence.node, seen.number)

    def on_example(self, lesson: TaughtExample) -> None:
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
            alive = {node.id for node in self._learner.nodes()}  # drop merged and deleted nodes
            for gone in [node for node in when if node not in alive]:
                del when[gone]

    def restored(self) -> None:
        self.used = {}
