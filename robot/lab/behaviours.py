"""Beyond the paper: other behaviours (its future work), taught in episodes, judged by purpose."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group
from robot.lab.ideas import make_learner, make_pilot
from robot.lab.metrics import driving
from robot.lab.metrics.log import DriveLog, DriveSample
from robot.lab.task import Params, Result, Task
from robot.lab.trial import Place, Trial
from robot.store.table import Table
from robot.types import Action, Mode

_MINUTES = {"episode_s": 60.0, "teach": 2, "correct": 2, "alone": 1}
_TAUGHT: Mapping[str, dict[str, Any]] = {
    "follow the wall on the right": {
        "world": "corridor",
        "teacher": "wall",
        "moves": ("forward", "left", "right"),
        **_MINUTES,
    },
    "follow the orange barrel": {
        "world": "follow",
        "teacher": "follow",
        "moves": ("forward", "left", "right", "backward"),
        **_MINUTES,
    },
    "push the blue box to a wall": {
        "world": "push",
        "teacher": "push",
        "moves": ("forward", "left", "right"),
        "episode_s": 40.0,
        "teach": 8,
        "correct": 4,
        "alone": 5,
    },
}
LEARNERS = ("published-32", "default-32", "default-128")


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    for what, behaviour in _TAUGHT.items():
        for learner in settings.learners or LEARNERS:
            for seed in range(settings.n_seeds):
                params = {**behaviour, "what": what, "learner": learner, "seed": seed}
                yield Task(run_episodes, params)


_COLUMNS = ("runs", "right m", "in view", "at wall", "seconds", "longest push s", "m/min")
_NAMES = ("right_m", "in_view", "brought_to_wall", "seconds", "longest_push_s", "driven_m_per_min")


def _tables(runs: Runs) -> list[Table]:
    """Return one table a behaviour, with all its teachers above the learners."""
    tables = []
    for what in _TAUGHT:
        mine = [run for run in runs if run[0].params["what"] == what]
        rows = {"teacher": [result["teacher"] for _, result in mine]}
        for (learner,), results in group(mine, "learner").items():
            rows[learner] = [result["alone"] for result in results]
        tables.append(
            Table(
                title=what[0].upper() + what[1:],
                columns=("who", *_COLUMNS),
                rows=tuple((name, *_cells(drives)) for name, drives in rows.items()),
            )
        )
    return tables


def _cells(drives: Sequence[Mapping[str, float | None]]) -> tuple[float | int | None, ...]:
    def mean(name: str) -> float | None:
        values = [value for drive in drives if (value := drive[name]) is not None]
        return statistics.fmean(values) if values else None

    return (len(drives), *map(mean, _NAMES))


AT_WALL_M = 0.02
"""A thing this near to a wall has been brought there."""
_IN_VIEW_RAD = math.radians(31.0)
_IN_REACH_M = 1.0


def run_episodes(params: Params) -> Result:
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


BEHAVIOURS = Experiment(
    name="behaviours",
    title="Beyond the paper: other behaviours",
    text="Taught in episodes, each from another start: two minutes of teaching and two of "
    "correction (pushing: eight episodes and four), then the robot alone. 'right': median "
    "distance from the robot's middle to what is at its right. 'in view': share of the time "
    "in which the thing is in the picture and within a metre. 'at wall': share of episodes "
    "in which the box was brought to a wall within 40 s.",
    plan=_plan,
    tables=_tables,
)
