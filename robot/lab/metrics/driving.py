"""Measures of a drive: collisions, pushing, distance, floor covered, interventions, agreement."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from robot.control.profile import compare, move_shares, rare_moves, steering_per_s
from robot.lab.metrics.log import DriveLog, DriveSample
from robot.types import Action

STAY_M, STUCK_S = 0.15, 20.0
"""A robot is stuck that stays within so little for so long: a full turn about one wheel takes
19.5 s."""
CELL_M = 0.1
"""Side of the squares in which covered floor is counted."""


def collisions_per_minute(log: DriveLog) -> float:
    """Return how often a minute the body touched something anew; a lasting contact counts once."""
    return _begun_per_minute([moment.is_touching for moment in log.moments], log)


def pushing_s_per_minute(log: DriveLog) -> float:
    """Return how many seconds a minute the robot drove against something."""
    return _per_minute(sum(seconds for moment, seconds in _spans(log) if moment.is_pushing), log)


def longest_push_s(log: DriveLog) -> float:
    """Return the longest time without a break for which the robot drove against something."""
    longest_s = current_s = 0.0
    for moment, seconds in _spans(log):
        current_s = current_s + seconds if moment.is_pushing else 0.0
        longest_s = max(longest_s, current_s)
    return longest_s


def driven_m(log: DriveLog) -> float:
    return sum(
        math.hypot(b.pose.x_m - a.pose.x_m, b.pose.y_m - a.pose.y_m)
        for a, b in pairwise(log.moments)
    )


def covered_m2(log: DriveLog) -> float:
    """Return the floor that the robot's centre crossed, in squares of 10 cm."""
    cells = {
        (math.floor(moment.pose.x_m / CELL_M), math.floor(moment.pose.y_m / CELL_M))
        for moment in log.moments
    }
    return len(cells) * CELL_M**2


def longest_stay_s(log: DriveLog) -> float:
    """Return the longest time for which the robot's centre stayed within a square of `STAY_M`."""
    longest_s, start = 0.0, 0
    places = np.array([(moment.pose.x_m, moment.pose.y_m) for moment in log.moments])
    for i, moment in enumerate(log.moments):
        while np.ptp(places[start : i + 1], axis=0).max() > STAY_M:
            start += 1
        longest_s = max(longest_s, moment.now_s - log.moments[start].now_s)
    return longest_s


def is_stuck(log: DriveLog) -> bool:
    """Return True if the robot stayed in one spot for `STUCK_S` or longer."""
    return longest_stay_s(log) >= STUCK_S


def interventions_per_minute(log: DriveLog) -> float:
    """Return how often a minute the pilot took the wheel from the robot."""
    return _begun_per_minute([moment.is_intervention for moment in log.moments], log)


def asking_share(log: DriveLog) -> float:
    """Return the share of ticks with a view that the robot did not know."""
    if not log.moments:
        return 0.0
    return sum(moment.asks_pilot for moment in log.moments) / len(log)


def agreement(log: DriveLog) -> float | None:
    """Return how often robot and teacher would have done the same, of the ticks with both."""
    both = [
        moment.proposed is moment.wanted
        for moment in log.moments
        if moment.proposed is not None and moment.wanted is not None
    ]
    return sum(both) / len(both) if both else None


def figures(log: DriveLog) -> dict[str, float]:
    """Return what every experiment tells of a drive."""
    return {
        "longest_push_s": longest_push_s(log),
        "stuck": is_stuck(log),
        "asking_share": asking_share(log),
        "driven_m": driven_m(log),
        "covered_m2": covered_m2(log),
        "steering_per_s": steering_per_s(log.steering(), [moment.now_s for moment in log.moments]),
    }


def against(log: DriveLog, teacher: DriveLog, moves: tuple[Action, ...]) -> dict[str, Any]:
    """Return the figures of a drive, and how far its Behavior Profile is from the teacher's."""
    difference = compare(teacher.profile(), log.profile(), moves)
    rare = rare_moves(move_shares(teacher.actions()), move_shares(log.actions()))
    return {
        "ssd": difference.ssd,
        "ssd_of_moves_made": difference.made,
        "ssd_frequent": sum(ssd for m, ssd in difference.per_move.items() if m not in rare),
        "never": [move.value for move in difference.never_by_robot],
        **figures(log),
    }


def _begun_per_minute(flags: list[bool], log: DriveLog) -> float:
    begun = sum(now and not before for before, now in pairwise([False, *flags]))
    return _per_minute(begun, log)


def _per_minute(amount: float, log: DriveLog) -> float:
    return 60 * amount / log.seconds if log.seconds else 0.0


def _spans(log: DriveLog) -> Iterator[tuple[DriveSample, float]]:
    """Yield each tick with the time until the next; the last one's is the mean."""
    yield from (
        (moment, following.now_s - moment.now_s) for moment, following in pairwise(log.moments)
    )
    if log.moments:
        yield log.moments[-1], log.seconds / len(log)
