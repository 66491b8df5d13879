"""The challenge's score: the metres that the robot drove by itself. Pure.

The path is divided into stretches of `STRETCH_M`, measured in a straight line. A stretch counts if
the robot drove it forward and nearly straight. So standing, turning on the spot and small circles
score nothing. If the robot drives back over a stretch, forward or backward, the stretch's score is
subtracted and the stretch never counts again, so driving back and forth scores nothing. A stretch
that is driven again in the same direction counts a half, then a third, so a larger course is worth
more than many rounds of a small course.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.types import Pose

STRETCH_M = 0.3
"""Length of a stretch, in metres: longer than a robot, and shorter than the straight part of a
course in the smallest box."""
_STRAIGHT_RAD = math.radians(25)
"""Largest angle between the robot's heading and the stretch, at either end, in radians."""
_SPOT_M = 0.02
"""Distance from the beginning of a stretch within which the robot may still turn, in metres."""
_NEAR_M, _ALIKE_RAD = 0.2, math.radians(50)
"""Two stretches are the same if their midpoints differ by at most `_NEAR_M` and their directions by
at most `_ALIKE_RAD`."""


@dataclass(slots=True)
class _Stretch:
    x_m: float
    y_m: float
    way_rad: float
    metres: float

    def is_near(self, other: _Stretch) -> bool:
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m) <= _NEAR_M


class Score:
    """The score of one try; call `note` with each pose while the robot drives by itself."""

    def __init__(self) -> None:
        self._start: Pose | None = None
        self._stretches: list[_Stretch] = []

    @property
    def metres(self) -> float:
        """The score so far, in metres."""
        return math.fsum(stretch.metres for stretch in self._stretches)

    def note(self, pose: Pose) -> None:
        """Process the robot's current pose."""
        if not all(map(math.isfinite, (pose.x_m, pose.y_m, pose.heading_rad))):
            return
        start = self._start
        if start is None:
            self._start = pose
            return
        x_m, y_m = pose.x_m - start.x_m, pose.y_m - start.y_m
        length_m = math.hypot(x_m, y_m)
        if length_m < STRETCH_M:
            if length_m < _SPOT_M:  # turns on the spot do not count
                self._start = replace(start, heading_rad=pose.heading_rad)
            elif _angle(pose.heading_rad, start.heading_rad) > 2 * _STRAIGHT_RAD:
                self._start = pose
            return
        self._start = pose
        if length_m > 2 * STRETCH_M:  # the robot was carried, or its pose corrected
            return
        way_rad = math.atan2(y_m, x_m)
        aside_rad = max(_angle(one.heading_rad, way_rad) for one in (start, pose))
        stretch = _Stretch(start.x_m + x_m / 2, start.y_m + y_m / 2, way_rad, 0.0)
        self._count(stretch, length_m if aside_rad <= _STRAIGHT_RAD else 0.0)

    def _count(self, stretch: _Stretch, length_m: float) -> None:
        near = [one for one in self._stretches if one.is_near(stretch)]
        turned = [_angle(one.way_rad, stretch.way_rad) for one in near]
        back = [one for one, a in zip(near, turned, strict=True) if a >= math.pi - _ALIKE_RAD]
        for one in back:
            one.metres = 0.0
        if not back:
            stretch.metres = length_m / (1 + sum(a <= _ALIKE_RAD for a in turned))
        self._stretches.append(stretch)


def _angle(a_rad: float, b_rad: float) -> float:
    """Return the angle between two directions, from 0 to pi."""
    return abs((a_rad - b_rad + math.pi) % math.tau - math.pi)
