"""Behavior Profile: at which distances does a driver make which move? And how far two differ.

P(d < c | move) for c = 0, 0.02, ..., 4 m, d the sonar reading, and the sum of squared differences
(SSD) of two profiles over all moves and all c: the measure of FLAIRS-30, 2017.

The paper does not say how to count a move that was never made. Here its profile is 0 for every c,
as that of no reading at all: a robot that never turns is then far from a teacher who does. Such
moves are named, and `made` gives the same sum over the moves that both made.
"""

from __future__ import annotations

from collections import Counter
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
    """Return the profile of a drive: what was done at which sonar reading. STOP is no move.

    Args:
        moves: The action of each tick.
        distances_m: The sonar reading of each tick, shape (n,).

    Raises:
        ValueError: If the two are not equally long.
    """
    distances = np.asarray(distances_m, np.float64)
    if distances.shape != (len(moves),):
        raise ValueError(f"{len(moves)} moves need as many distances, not {distances.shape}")
    names = np.array([str(move) for move in moves])
    return {
        Action(name): (distances[names == name][:, None] < THRESHOLDS_M).mean(axis=0)
        for name in np.unique(names)
        if name != Action.STOP
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How far the robot's profile is from the teacher's."""

    per_move: Mapping[Action, float]
    never_by_teacher: tuple[Action, ...]
    never_by_robot: tuple[Action, ...]

    @property
    def ssd(self) -> float:
        """The published figure: summed over all moves, one never made counting as P = 0."""
        return float(sum(self.per_move.values()))

    @property
    def made(self) -> float:
        """The same over the moves that both made."""
        never = {*self.never_by_teacher, *self.never_by_robot}
        return float(sum(ssd for move, ssd in self.per_move.items() if move not in never))


def compare(teacher: Profile, robot: Profile, moves: Sequence[Action]) -> Difference:
    """Return the squared differences of two profiles, for each of `moves` and in sum."""
    nothing = np.zeros(len(THRESHOLDS_M))
    return Difference(
        per_move={
            move: float(((teacher.get(move, nothing) - robot.get(move, nothing)) ** 2).sum())
            for move in moves
        },
        never_by_teacher=tuple(move for move in moves if move not in teacher),
        never_by_robot=tuple(move for move in moves if move not in robot),
    )


def steering_per_s(steering: ArrayLike, at_s: ArrayLike) -> float:
    """Return by how much steering changes a second, as root mean square: the smoother, the less.

    Args:
        steering: From -1 to 1 at each tick, shape (n,).
        at_s: The times of the ticks, shape (n,).
    """
    rates = np.diff(np.asarray(steering, np.float64)) / np.diff(np.asarray(at_s, np.float64))
    return float(np.sqrt((rates**2).mean())) if rates.size else 0.0


RARE_SHARE = 0.05
"""A move on fewer of the ticks is rare: a slip taught once and never repeated costs up to 200."""


def move_shares(moves: Sequence[Action]) -> dict[Action, float]:
    """Return each move's share of the ticks on which the robot moved."""
    counts = Counter(move for move in moves if move is not Action.STOP)
    return {move: count / counts.total() for move, count in counts.items()}


def rare_moves(teacher: Mapping[Action, float], robot: Mapping[Action, float]) -> set[Action]:
    """Return the moves that both make on less than `RARE_SHARE` of their ticks."""
    return {
        move
        for move in {*teacher, *robot}
        if max(teacher.get(move, 0.0), robot.get(move, 0.0)) < RARE_SHARE
    }
