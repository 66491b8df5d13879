"""A behaviour taught in episodes, with the world reset after each, and measured by its purpose."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import Any

from robot.lab.ideas import make_learner
from robot.lab.metrics import driving
from robot.lab.metrics.log import DriveLog, DriveSample
from robot.lab.pilots import make_pilot
from robot.lab.task import Result
from robot.lab.trial import Place, Trial
from robot.types import Action, Mode

AT_WALL_M = 0.02
"""A thing this near to a wall has been brought there."""
_IN_VIEW_RAD = math.radians(31.0)
_IN_REACH_M = 1.0


def run_episodes(params: Mapping[str, Any]) -> Result:
    """Teach in some episodes, correct in some, then let the robot drive some alone.

    Parameters: `world`, `teacher`, `moves`, `learner`, `seed`, `episode_s`, and how many episodes
    of each: `teach`, `correct`, `alone`. An episode ends when a movable thing is at a wall.
    """
    moves = tuple(Action(move) for move in params["moves"])
    place = Place(world=params["world"], seed=params["seed"])
    with Trial(place, make_learner(params["learner"], moves), make_pilot(params, moves)) as trial:
        can_end = any(thing.is_movable for thing in trial.driver.simulation.world.obstacles)

        def episodes(mode: Mode, count: int, *, supervised: bool = True) -> list[DriveLog]:
            drives = []
            for _ in range(count):
                trial.driver.simulation.restart()
                drives.append(
                    trial.drive(
                        mode,
                        params["episode_s"],
                        supervised=supervised,
                        until=_is_at_wall if can_end else lambda moment: False,
                    )
                )
            return drives

        taught = episodes(Mode.TRAIN, params["teach"])
        episodes(Mode.AUTONOMOUS, params["correct"])
        alone = episodes(Mode.AUTONOMOUS, params["alone"], supervised=False)
    return {"teacher": _figures(taught), "alone": _figures(alone)}


def _is_at_wall(moment: DriveSample) -> bool:
    return moment.target_gap_m is not None and moment.target_gap_m < AT_WALL_M


def _figures(drives: Sequence[DriveLog]) -> dict[str, float | None]:
    moments = [moment for drive in drives for moment in drive.moments]
    ends = [drive.moments[-1] for drive in drives]
    figures: dict[str, float | None] = {
        "seconds": statistics.fmean(drive.seconds for drive in drives),
        "longest_push_s": max(driving.longest_push_s(drive) for drive in drives),
        "right_m": statistics.median(moment.right_m or 0.0 for moment in moments),
        "driven_m_per_min": sum(map(driving.driven_m, drives))
        / sum(drive.seconds for drive in drives)
        * 60,
        "in_view": None,
        "brought_to_wall": None,
    }
    if ends[0].target_m is not None:
        seen = [
            abs(moment.target_bearing_rad or 0.0) < _IN_VIEW_RAD
            and (moment.target_m or 0.0) < _IN_REACH_M
            for moment in moments
        ]
        figures["in_view"] = sum(seen) / len(seen)
        figures["brought_to_wall"] = sum(map(_is_at_wall, ends)) / len(ends)
    return figures
