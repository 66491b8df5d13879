"""The log of a drive, tick by tick, as columns; all metrics are made from it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robot.control.profile import Profile, behavior_profile
from robot.driver import point_of
from robot.lab.simulated_pilots.situation import Situation
from robot.types import Action, DrivenBy, Point, Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSample:
    """One tick of a drive. `distance_m` is what the sonar read before the action was chosen."""

    now_s: float
    action: Action
    driven_by: DrivenBy
    distance_m: float
    pose: Pose
    is_touching: bool = False
    is_pushing: bool = False
    point: Point | None = None
    """What was driven, by degrees; None if a move was."""
    asks_pilot: bool = False
    is_intervention: bool = False
    proposed: Action | None = None
    wanted: Action | None = None
    situation: Situation | None = None
    """What there was to see."""


@dataclass(slots=True)
class DriveLog:
    """The moments of one drive, in time order."""

    moments: list[DriveSample] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.moments)

    def add(self, moment: DriveSample) -> None:
        self.moments.append(moment)

    @property
    def seconds(self) -> float:
        """How long the drive was, the last tick included."""
        if len(self.moments) < 2:
            return 0.0
        span_s = self.moments[-1].now_s - self.moments[0].now_s
        return span_s * len(self.moments) / (len(self.moments) - 1)

    def driven_by(self, who: DrivenBy) -> DriveLog:
        """Return the part in which `who` drove. Its ticks need not be consecutive."""
        return DriveLog([moment for moment in self.moments if moment.driven_by is who])

    def last(self, seconds: float) -> DriveLog:
        if not self.moments:
            return DriveLog()
        since_s = self.moments[-1].now_s - seconds + 1e-9
        return DriveLog([moment for moment in self.moments if moment.now_s > since_s])

    def actions(self) -> list[Action]:
        return [moment.action for moment in self.moments]

    def steering(self) -> list[float]:
        """Return where each tick steered, from -1 to 1; a move steers as it is declared."""
        points = [moment.point or point_of(moment.action) for moment in self.moments]
        return [point.steering if point else 0.0 for point in points]

    def profile(self) -> Profile:
        return behavior_profile(
            [moment.action for moment in self.moments],
            np.array([moment.distance_m for moment in self.moments]),
        )
