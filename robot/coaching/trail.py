"""The robot's trail: who drove where, and where it asked for help, pushed or was corrected. Pure.

A trail shows where one model was taught and drove, in one world. For another model or world, a new
trail begins.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

from robot.control.state import Tick
from robot.driver import Pose
from robot.policy.events import Replaced
from robot.types import Action, DrivenBy, Mode

STEP_M, STEP_RAD = 0.03, math.radians(10)
"""Distance in metres, or turn in radians, after which a new point is added. A point is also
added when the pilot or the robot takes over."""
POINTS = 2000
"""Maximum number of points, enough for seven minutes at the paper's speed. The oldest points are
dropped first."""


class Event(StrEnum):
    """What happened at a point of the trail."""

    ASKED = "asked"  # the robot did not know what to do
    PUSHED = "pushed"  # the robot drove into an obstacle
    CORRECTED = "corrected"  # the pilot took the wheel from the robot


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """One point of the trail, with who drove there and the events that began there."""

    pose: Pose
    driven_by: DrivenBy
    events: tuple[Event, ...] = ()


class Trail:
    """Follows one robot. Call `note` only on the loop's thread, and `since` on one other thread."""

    def __init__(self) -> None:
        self._points: deque[Waypoint] = deque(maxlen=POINTS)
        self._n = 0
        self._lasting: frozenset[Event] = frozenset()

    def note(self, tick: Tick) -> None:
        """Process one tick."""
        if any(isinstance(event, Replaced) for event in tick.history_events):
            self.begin()
        lasting = frozenset(_events(tick))
        new, self._lasting = lasting - self._lasting, lasting
        pose = tick.sensors.pose
        if pose is None:
            return
        by = tick.decision.driven_by
        last = self._points[-1] if self._points else None
        if not new and last is not None and last.driven_by is by and not _is_far(last.pose, pose):
            return
        self._points.append(Waypoint(pose=pose, driven_by=by, events=tuple(sorted(new))))
        self._n += 1

    def begin(self) -> None:
        """Begin a new trail. Only the loop's thread may call it."""
        self._points.clear()
        self._n += 1  # the numbers no longer match, so clients drop their old points

    def since(self, number: int) -> tuple[int, list[Waypoint]]:
        """Return the points from `number` on, and the number of the first returned point.

        A client requests the number after its newest point, and appends the answer. If old points
        were dropped or a new trail began, all points are returned, with another first number.
        """
        points = list(self._points)
        first = self._n - len(points)
        start = number if first <= number <= self._n else first
        return start, points[start - first :]


def _events(tick: Tick) -> list[Event]:
    decision, events = tick.decision, []
    if decision.mode is Mode.AUTONOMOUS and decision.driven_by is DrivenBy.PILOT:
        events.append(Event.CORRECTED)
    if decision.mode is Mode.AUTONOMOUS and decision.asks_pilot:
        events.append(Event.ASKED)
    is_stalled = tick.prediction is not None and tick.prediction.is_stalled
    if tick.sent is not Action.STOP and (tick.sensors.bumped or is_stalled):
        events.append(Event.PUSHED)
    return events


def _is_far(a: Pose, b: Pose) -> bool:
    turned_rad = abs(math.remainder(a.heading_rad - b.heading_rad, math.tau))
    return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m) >= STEP_M or turned_rad >= STEP_RAD
