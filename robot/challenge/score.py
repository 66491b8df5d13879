"""The challenge's score: the metres that the robot drove by itself. Pure.

The path is divided into stretches of `STRETCH_M`, measured in a straight line. A stretch counts if
the robot drove it forward and nearly straight, and if the previous or the next stretch has nearly
the same direction. So a robot scores nothing by standing still, by spinning, or by driving in
circles smaller than the smallest box. Metres driven backward are subtracted. If the robot drives
back over a stretch, the stretch's score is subtracted, and the stretch never counts again. So a
robot that drives back and forth scores nothing. A stretch that the robot repeats in the same
direction scores half of its length the second time, and one third of its length the third time. So
a larger course is worth more than many rounds of a small course.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.driver import Pose

STRETCH_M = 0.2
"""Length of a stretch, in metres: about the length of a robot."""
_STRAIGHT_RAD = math.radians(25)
"""Largest change of the robot's heading within a stretch, in radians. A larger change begins a new
stretch."""
_ONWARD_RAD = math.radians(20)
"""Largest angle between two successive stretches of a straight run, in radians. On a circle with a
radius below 0.57 m, half the width of the smallest box, the angle is larger, so such a circle does
not score."""
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
    """The score of one try. Call `note` with each pose while the robot drives by itself."""

    def __init__(self) -> None:
        self._start: Pose | None = None
        self._stretches: list[_Stretch] = []
        self._run: list[_Stretch] = []
        """The stretches of the current straight run; the first counts only if a second one
        follows."""
        self._backward_m = 0.0

    @property
    def metres(self) -> float:
        """The score so far, in metres."""
        forward_m = math.fsum(stretch.metres for stretch in self._stretches)
        return max(0.0, forward_m - self._backward_m)

    def note(self, pose: Pose) -> None:
        """Process the robot's current pose."""
        if not all(map(math.isfinite, (pose.x_m, pose.y_m, pose.heading_rad))):
            return
        start = self._start
        if start is None:
            self._start = pose
            return
        x_m, y_m = pose.x_m - start.x_m, pose.y_m - start.y_m
        length_m, way_rad = math.hypot(x_m, y_m), math.atan2(y_m, x_m)
        turned_rad = _angle(pose.heading_rad, start.heading_rad)
        if length_m < STRETCH_M and turned_rad <= _STRAIGHT_RAD:
            return
        self._start = pose
        if length_m > 2 * STRETCH_M:  # the robot was carried, or its pose was corrected
            self._run = []
            return
        aside_rad = max(_angle(one.heading_rad, way_rad) for one in (start, pose))
        if length_m >= STRETCH_M and aside_rad <= _STRAIGHT_RAD:
            self._add_stretch(_Stretch(start.x_m + x_m / 2, start.y_m + y_m / 2, way_rad, length_m))
            return
        self._run = []
        # half of `STRETCH_M` is enough, because a body that turns drives less far
        if aside_rad > math.pi / 2 and length_m >= STRETCH_M / 2:
            self._backward_m += length_m

    def _add_stretch(self, stretch: _Stretch) -> None:
        """Add a stretch to the current straight run, or to a new run if its direction differs too
        much from that of the previous stretch. A run's first stretch is counted only when the
        second one is added, because a single stretch does not count."""
        if self._run and _angle(self._run[-1].way_rad, stretch.way_rad) > _ONWARD_RAD:
            self._run = []
        self._run.append(stretch)
        if len(self._run) == 2:
            self._count(self._run[0])
        if len(self._run) >= 2:
            self._count(stretch)

    def _count(self, stretch: _Stretch) -> None:
        near = [one for one in self._stretches if one.is_near(stretch)]
        turned = [_angle(one.way_rad, stretch.way_rad) for one in near]
        back = [one for one, a in zip(near, turned, strict=True) if a >= math.pi - _ALIKE_RAD]
        for one in back:
            one.metres = 0.0
        if back:
            stretch.metres = 0.0
        else:
            stretch.metres /= 1 + sum(a <= _ALIKE_RAD for a in turned)
        self._stretches.append(stretch)


def _angle(a_rad: float, b_rad: float) -> float:
    """Return the angle between two directions, from 0 to pi."""
    return abs((a_rad - b_rad + math.pi) % math.tau - math.pi)
