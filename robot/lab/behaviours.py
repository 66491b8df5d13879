"""Experiment on behaviours that the paper leaves to future work. The behaviours are taught in
episodes, and judged by how well they achieve their purpose."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from robot.lab import metrics
from robot.lab.chance import mean_of_known
from robot.lab.experiment import Experiment, ExperimentSettings, Runs, seeded
from robot.lab.ideas import make_trial
from robot.lab.metrics import DriveLog, DriveSample
from robot.lab.tables import Columns, of, tables_of
from robot.lab.task import Params, Result, Task
from robot.study.table import Table
from robot.types import Mode

_MINUTES = {"episode_s": 60.0, "teach": 2, "correct": 2, "alone": 1}
_PUSHES = {"episode_s": 40.0, "teach": 8, "correct": 4, "alone": 5}
_MOVES = ("forward", "left", "right")
_BACK = (*_MOVES, "backward")
_TAUGHT: Mapping[str, dict[str, Any]] = {
    "follow the wall on the right": {"world": "corridor", "teacher": "wall", "moves": _MOVES},
    "follow the orange barrel": {"world": "follow", "teacher": "follow", "moves": _BACK},
    "push the blue box to a wall": {"world": "push", "teacher": "push", "moves": _MOVES, **_PUSHES},
}
LEARNERS = ("published-32", "default-32", "default-128")


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    learners = settings.learners or LEARNERS
    cases = (
        {**_MINUTES, **behaviour, "what": what, "learner": learner}
        for (what, behaviour), learner in product(_TAUGHT.items(), learners)
    )
    return seeded(run_episodes, cases, settings)


def _tables(runs: Runs) -> list[Table]:
    own = [
        (task.params["what"].capitalize(), task.params["learner"], result) for task, result in runs
    ]
    teachers = [(what, "teacher", result["teacher"]) for what, _, result in own]
    robots = [(what, learner, result["alone"]) for what, learner, result in own]
    return tables_of([*teachers, *robots], _COLUMNS, "who")


_COLUMNS: Columns = {
    "runs": len,
    "right m": of("right_m", statistics.fmean),
    "in view": of("in_view", mean_of_known),
    "at wall": of("brought_to_wall", mean_of_known),
    "seconds": of("seconds", statistics.fmean),
    "longest push s": of("longest_push_s", statistics.fmean),
    "m/min": of("driven_m_per_min", statistics.fmean),
}

AT_WALL_M = 0.02
"""Largest distance from a wall at which a thing counts as brought to the wall, in metres."""
_IN_VIEW_RAD = math.radians(31.0)
_IN_REACH_M = 1.0


def run_episodes(params: Params) -> Result:
    """Teach in the first episodes, correct in the next, and let the robot drive unaided in the
    last.

    Parameters: `world`, `teacher`, `moves`, `learner`, `seed`, `episode_s`, and the numbers of
    episodes `teach`, `correct` and `alone`. An episode ends when a movable thing is at a wall.
    """
    drives: dict[str, list[DriveLog]] = {"teach": [], "correct": [], "alone": []}
    with make_trial(params) as trial:
        can_end = any(thing.is_movable for thing in trial.driver.simulation.world.obstacles)
        until = _is_at_wall if can_end else None
        for phase, driven in drives.items():
            mode = Mode.TRAIN if phase == "teach" else Mode.AUTONOMOUS
            for _ in range(params[phase]):
                trial.driver.simulation.restart()
                drive = trial.drive(
                    mode, params["episode_s"], supervised=phase != "alone", until=until
                )
                driven.append(drive)
    return {"teacher": _figures(drives["teach"]), "alone": _figures(drives["alone"])}


def _is_at_wall(moment: DriveSample) -> bool:
    target = moment.situation.target if moment.situation is not None else None
    return target is not None and target.wall_gap_m < AT_WALL_M


def _figures(drives: Sequence[DriveLog]) -> dict[str, float | None]:
    moments = [moment for drive in drives for moment in drive]
    views = [moment.situation for moment in moments if moment.situation is not None]
    targets = [view.target for view in views if view.target is not None]
    ends = [drive[-1] for drive in drives]
    is_seen = [
        abs(target.bearing_rad) < _IN_VIEW_RAD and target.distance_m < _IN_REACH_M
        for target in targets
    ]
    return {
        "seconds": statistics.fmean(drive.seconds for drive in drives),
        "longest_push_s": max(metrics.longest_push_s(drive) for drive in drives),
        "right_m": statistics.median(view.range_at_m(-math.pi / 2) for view in views),
        "driven_m_per_min": sum(map(metrics.driven_m, drives))
        / sum(drive.seconds for drive in drives)
        * 60,
        "in_view": sum(is_seen) / len(is_seen) if targets else None,
        "brought_to_wall": sum(map(_is_at_wall, ends)) / len(ends) if targets else None,
    }


BEHAVIOURS = Experiment(
    title="Beyond the paper: other behaviours",
    text="Taught in episodes, each from a different start: two minutes of teaching, then two of "
    "correction (pushing: eight episodes, then four). Then the robot drives unaided. 'right': "
    "median distance from the robot's middle to the nearest thing on its right. 'in view': "
    "share of the time in which the thing is in the picture and within a metre. 'at wall': "
    "share of the episodes in which the box was brought to a wall within 40 s.",
    plan=_plan,
    tables=_tables,
)
