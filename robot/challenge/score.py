"""The challenge's number: metres that the robot drove by itself, and what does not count. Pure.

The way is cut into stretches of `STRETCH_M`, as the crow flies. One counts if the robot drove it
forwards and nearly straight. So standing, turning on the spot and small circles score nothing. A
way back over a stretch, forwards or backwards, takes back what it counted, and it never counts
again: so does driving to and fro. A stretch that is driven again in the same direction counts a
half, then a third: a larger course is worth more than many rounds of a small one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.types import Pose

STRETCH_M = 0.3
"""Length of a stretch, in metres: shorter than the straight part of a course in the smallest box,
longer than a robot."""
_STRAIGHT_RAD = math.radians(25)
"""By how much the robot may point aside of the stretch at either end, in radians."""
_SPOT_M = 0.02
"""Within how far of its beginning a stretch may still be turned, in metres."""
_NEAR_M, _ALIKE_RAD = 0.2, math.radians(50)
"""Two stretches are the same if their middles and directions differ by at most this much."""


@dataclass(slots=True)
class _Stretch:
    x_m: float
    y_m: float
    way_rad: float
    metres: float

    def is_near(self, other: _Stretch) -> bool:
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m) <= _NEAR_M


class Score:
    """Adds up one try; call `note` with each pose while the robot drives by itself."""

    def __init__(self) -> None:
        self._start: Pose | None = None
        self._stretches: list[_Stretch] = []

    @property
    def metres(self) -> float:
        """What counts by now."""
        return math.fsum(stretch.metres for stretch in self._stretches)

    def note(self, pose: Pose) -> None:
        """Take in where the robot is now."""
        if not all(map(math.isfinite, (pose.x_m, pose.y_m, pose.heading_rad))):
            return
        start = self._start
        if start is None:
            self._start = pose
            return
        x_m, y_m = pose.x_m - start.x_m, pose.y_m - start.y_m
        length_m = math.hypot(x_m, y_m)
        if length_m < STRETCH_M:
            if length_m < _SPOT_M:  # a turn on the spot is no part of a stretch
                self._start = replace(start, heading_rad=pose.heading_rad)
            elif _angle(pose.heading_rad, start.heading_rad) > 2 * _STRAIGHT_RAD:
                self._start = pose
            return
        self._start = pose
        if length_m > 2 * STRETCH_M:  # it was carried, or its pose was corrected
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
