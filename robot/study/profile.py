"""The Behavior Profile, which describes at what distances a driver makes each move, and the
difference between two profiles.

A profile is P(d < c | move) for c = 0, 0.02, ..., 4 m, where d is the sonar reading. Two profiles
are compared by the sum of squared differences (SSD), over all moves and all c. Source: FLAIRS-30
(2017).

The paper does not define the profile of a move that was never made. In this module it is 0 for
every c, so the SSD is large if one driver turns and the other never turns. A `Difference` lists
the moves that each driver never made. Its property `made` is the SSD of only the moves that both
drivers made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot.types import Action

THRESHOLDS_M: NDArray[np.float64] = np.linspace(0.0, 4.0, 201)
"""The values of c: 0, 0.02, ..., 4 m."""

Profile = Mapping[Action, NDArray[np.float64]]
"""For each move that was made, P(d < c | move) at each threshold, shape (201,)."""


def behavior_profile(moves: Sequence[Action], distances_m: ArrayLike) -> Profile:
    """Return the profile of a drive from its moves and sonar readings. STOP is not a move.

    Each tick has an action and a reading, shape (n,); raises ValueError if the lengths differ.
    """
    distances = np.asarray(distances_m, np.float64)
    if distances.shape != (len(moves),):
        raise ValueError(
            f"there are {len(moves)} moves, but the distances have shape {distances.shape}"
        )
    names = np.array([str(move) for move in moves])
    return {
        Action(name): (distances[names == name][:, None] < THRESHOLDS_M).mean(axis=0)
        for name in np.unique(names)
        if name != Action.STOP
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """The difference between the robot's profile and the teacher's."""

    per_move: Mapping[Action, float]
    never_by_teacher: tuple[Action, ...]
    never_by_robot: tuple[Action, ...]

    @property
    def ssd(self) -> float:
        """The published figure: the sum over all moves. A move that was never made counts as P =
        0."""
        return float(sum(self.per_move.values()))

    @property
    def made(self) -> float:
        """The sum over the moves that both drivers made."""
        never = {*self.never_by_teacher, *self.never_by_robot}
        return float(sum(ssd for move, ssd in self.per_move.items() if move not in never))


def compare(teacher: Profile, robot: Profile, moves: Sequence[Action]) -> Difference:
    """Return the squared differences of two profiles, for each of `moves` and in total."""
    nothing = np.zeros(len(THRESHOLDS_M))
    return Difference(
        per_move={
            move: float(((teacher.get(move, nothing) - robot.get(move, nothing)) ** 2).sum())
            for move in moves
        },
        never_by_teacher=tuple(move for move in moves if move not in teacher),
        never_by_robot=tuple(move for move in moves if move not in robot),
    )
