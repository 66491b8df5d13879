"""The log of a drive, tick by tick, and its measures.

The measures are collisions, pushing, distance, floor covered, agreement and others. Pure.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robot.driver import Pose
from robot.lab.simulated_pilots.situation import Situation
from robot.moves import point_of
from robot.study.profile import Profile, behavior_profile, compare
from robot.types import Action, DrivenBy, Point

STAY_M, STUCK_S = 0.15, 20.0
"""A robot that stays within `STAY_M` metres for `STUCK_S` seconds is stuck. `STUCK_S` is longer
than a full turn about one wheel, which takes 19.5 s."""
CELL_M = 0.1
"""Side of the squares in which covered floor is counted, in metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSample:
    """One tick of a drive. `distance_m` is the sonar's reading before the action was chosen."""

    now_s: float
    action: Action
    driven_by: DrivenBy
    distance_m: float
    pose: Pose
    is_touching: bool = False
    is_pushing: bool = False
    point: Point | None = None
    """The steering and throttle that were sent to the robot. None if a named move was sent."""
    asks_pilot: bool = False
    proposed: Action | None = None
    wanted: Action | None = None
    situation: Situation | None = None
    """The situation that the pilot saw."""


class DriveLog(list[DriveSample]):
    """The ticks of one drive, in time order."""

    @property
    def seconds(self) -> float:
        """The duration of the drive, including the last tick."""
        if len(self) < 2:
            return 0.0
        return (self[-1].now_s - self[0].now_s) * len(self) / (len(self) - 1)

    def last(self, seconds: float) -> DriveLog:
        return DriveLog(m for m in self if m.now_s > self[-1].now_s - seconds + 1e-9)

    def actions(self) -> list[Action]:
        return [moment.action for moment in self]

    def steering(self) -> list[float]:
        """Return each tick's steering from -1 to 1; a move has its declared steering."""
        points = [moment.point or point_of(moment.action) for moment in self]
        return [point.steering if point else 0.0 for point in points]

    def profile(self) -> Profile:
        return behavior_profile(self.actions(), [moment.distance_m for moment in self])


def collisions_per_minute(log: DriveLog) -> float:
    """Return the number of new contacts per minute. A contact of any length counts once."""
    flags = [moment.is_touching for moment in log]
    begun = sum(now and not before for before, now in pairwise([False, *flags]))
    return _per_minute(begun, log)


def pushing_s_per_minute(log: DriveLog) -> float:
    """Return the seconds per minute for which the robot drove against something."""
    return _per_minute(sum(seconds for moment, seconds in _spans(log) if moment.is_pushing), log)


def longest_push_s(log: DriveLog) -> float:
    """Return the longest uninterrupted time for which the robot drove against something."""
    longest_s = current_s = 0.0
    for moment, seconds in _spans(log):
        current_s = current_s + seconds if moment.is_pushing else 0.0
        longest_s = max(longest_s, current_s)
    return longest_s


def driven_m(log: DriveLog) -> float:
    return sum(
        math.hypot(b.pose.x_m - a.pose.x_m, b.pose.y_m - a.pose.y_m) for a, b in pairwise(log)
    )


def covered_m2(log: DriveLog) -> float:
    """Return the floor area that the robot's centre crossed, counted in squares of 10 cm."""
    cells = {
        (math.floor(moment.pose.x_m / CELL_M), math.floor(moment.pose.y_m / CELL_M))
        for moment in log
    }
    return len(cells) * CELL_M**2


def longest_stay_s(log: DriveLog) -> float:
    """Return the longest time for which the robot's centre stayed within a square of `STAY_M`."""
    longest_s, start = 0.0, 0
    places = np.array([(moment.pose.x_m, moment.pose.y_m) for moment in log])
    for i, moment in enumerate(log):
        while np.ptp(places[start : i + 1], axis=0).max() > STAY_M:
            start += 1
        longest_s = max(longest_s, moment.now_s - log[start].now_s)
    return longest_s


def is_stuck(log: DriveLog) -> bool:
    """Return True if the robot stayed within `STAY_M` for `STUCK_S` or longer."""
    return longest_stay_s(log) >= STUCK_S


def asking_share(log: DriveLog) -> float:
    """Return the share of ticks on which the robot asked for help."""
    return sum(moment.asks_pilot for moment in log) / max(len(log), 1)


def agreement(log: DriveLog) -> float | None:
    """Return the share of ticks on which robot and teacher chose the same move. Ticks on which
    robot or teacher chose no move are left out."""
    both = [
        moment.proposed is moment.wanted
        for moment in log
        if moment.proposed is not None and moment.wanted is not None
    ]
    return sum(both) / len(both) if both else None


def figures(log: DriveLog) -> dict[str, float]:
    """Return the measures of a drive that all experiments report."""
    return {
        "longest_push_s": longest_push_s(log),
        "pushing_s_per_min": pushing_s_per_minute(log),
        "collisions_per_min": collisions_per_minute(log),
        "stuck": is_stuck(log),
        "asking_share": asking_share(log),
        "driven_m": driven_m(log),
        "covered_m2": covered_m2(log),
        "steering_per_s": steering_per_s(log.steering(), [moment.now_s for moment in log]),
    }


def against(log: DriveLog, teacher: DriveLog, moves: tuple[Action, ...]) -> dict[str, Any]:
    """Return the measures of a drive, with the difference between the robot's Behavior Profile and
    the teacher's."""
    difference = compare(teacher.profile(), log.profile(), moves)
    rare = rare_moves(move_shares(teacher.actions()), move_shares(log.actions()))
    return {
        "ssd": difference.ssd,
        "ssd_of_moves_made": difference.made,
        "ssd_frequent": sum(ssd for m, ssd in difference.per_move.items() if m not in rare),
        "never": [move.value for move in difference.never_by_robot],
        **figures(log),
    }


def _per_minute(amount: float, log: DriveLog) -> float:
    return 60 * amount / log.seconds if log.seconds else 0.0


def _spans(log: DriveLog) -> Iterator[tuple[DriveSample, float]]:
    """Yield each tick with its duration: the time until the next tick, or the mean of these times
    for the last tick."""
    yield from ((moment, following.now_s - moment.now_s) for moment, following in pairwise(log))
    if log:
        yield log[-1], log.seconds / len(log)


def steering_per_s(steering: ArrayLike, at_s: ArrayLike) -> float:
    """Return the root mean square of the steering's change per second; smaller is smoother.

    Args:
        steering: Steering from -1 to 1 at each tick, shape (n,).
        at_s: The times of the ticks, shape (n,).
    """
    rates = np.diff(np.asarray(steering, np.float64)) / np.diff(np.asarray(at_s, np.float64))
    return float(np.sqrt((rates**2).mean())) if rates.size else 0.0


RARE_SHARE = 0.05
"""Share of ticks below which a move is rare. `ssd_frequent` ignores rare moves, because a move that
a person made only once, by mistake, could add 200 to the sum of squared differences."""


def move_shares(moves: Sequence[Action]) -> dict[Action, float]:
    """Return each move's share of the ticks on which the robot moved."""
    counts = Counter(move for move in moves if move is not Action.STOP)
    return {move: count / counts.total() for move, count in counts.items()}


def rare_moves(teacher: Mapping[Action, float], robot: Mapping[Action, float]) -> set[Action]:
    """Return the moves whose share is less than `RARE_SHARE` for the teacher and also for the
    robot."""
    return {
        move
        for move in {*teacher, *robot}
        if max(teacher.get(move, 0.0), robot.get(move, 0.0)) < RARE_SHARE
    }
