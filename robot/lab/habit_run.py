"""One robot taught by one kind of pilot, and how it then drives beside that pilot."""

from __future__ import annotations

import statistics
from typing import Any

from robot.control.profile import behavior_profile, compare
from robot.lab.ideas import make_learner
from robot.lab.metrics import driving
from robot.lab.metrics.log import DriveLog
from robot.lab.simulated_pilots.habits import HABITS, Habit
from robot.lab.task import Params, Result
from robot.lab.trial import Trial, drive_by_hand
from robot.types import Action, Mode

_MEANS = ("driven_m", "covered_m2", "ssd", "ssd_frequent", "ssd_alike", "steering_per_s")
DRIFT_SHARE = 0.15
"""Drift of the wheels while a simulated pilot teaches. In a second of driving straight the heading
changes by 17 degrees (standard deviation)."""


def run_habit(params: Params) -> Result:
    """Teach, drive alone, correct, drive alone again; and the pilot from where the robot began.

    In a minute neither sees all of a place, and from another corner the difference would be that of
    the corners. The pilot's minutes have the lesson's frame rate, too: with ten pictures a second a
    hand moves later than with thirty, and who follows a wall drives it otherwise.

    Parameters: `habit`, `world`, `learner`, `rate_hz`, `seed`, `teach_s`, `correct_s`, `alone_s`,
    `reference_s`, `drift`.
    """
    habit, world, seed = HABITS[params["habit"]], params["world"], params["seed"]
    name, rate_hz = f"{params['habit']} {seed}", params["rate_hz"]
    with Trial(
        world,
        seed,
        make_learner(params["learner"], habit.moves),
        habit.pilot(name),
        rate_hz=rate_hz,
        drift=params.get("drift", DRIFT_SHARE),
    ) as trial:
        alone_s = params.get("alone_s", 60.0)
        taught = trial.drive(Mode.TRAIN, params["teach_s"])
        drives = {"before": trial.drive(Mode.AUTONOMOUS, alone_s, supervised=False)}
        if params.get("correct_s"):
            trial.drive(Mode.AUTONOMOUS, params["correct_s"])
            drives["after"] = trial.drive(Mode.AUTONOMOUS, alone_s, supervised=False)
        timing, lessons = trial.timing(), dict(trial.loop.state.taught)
    result: Result = {}
    for phase, drive in drives.items():
        n_minutes = round(params.get("reference_s", 180.0) / 60.0)
        minutes = pilots_minutes(habit, name, world, seed, rate_hz, n_minutes, drive)
        result[phase] = beside_pilot(drive, minutes, taught, habit.moves)
    result["lessons"] = {move.value: n for move, n in sorted(lessons.items())}
    result["timing"] = timing
    return result


def pilots_minutes(
    habit: Habit, name: str, world: str, seed: int, rate_hz: float, n_minutes: int, drive: DriveLog
) -> list[DriveLog]:
    """Have the pilot drive some minutes himself, each from where the robot's drive began."""
    start = drive.moments[0].pose
    return [
        drive_by_hand(
            world, seed + 1000 * i, habit.pilot(f"{name} {i}"), 60.0, rate_hz, start=start
        )
        for i in range(n_minutes)
    ]


def beside_pilot(
    drive: DriveLog, minutes: list[DriveLog], taught: DriveLog, moves: tuple[Action, ...]
) -> dict[str, Any]:
    """Return the figures of a robot's minute, and those of its pilot's own minutes.

    A push counts as the pilot's in the lesson, too: there the robot learned it.
    """
    pilot = DriveLog([moment for minute in minutes for moment in minute.moments])
    own, *each = (
        {
            **driving.against(log, pilot, moves),
            "ssd_alike": _ssd_of_turns_alike(log, pilot),
        }
        for log in (drive, *minutes)
    )
    teacher = {
        key: statistics.fmean(float(figures[key]) for figures in each) for key in (*_MEANS, "stuck")
    }
    teacher["longest_push_s"] = max(driving.longest_push_s(log) for log in (taught, *minutes))
    return {**own, "teacher": teacher}


def _ssd_of_turns_alike(drive: DriveLog, teacher: DriveLog) -> float:
    """Return the SSD with left and right as one move: which side it is, is often chance."""
    taught, driven = (
        behavior_profile(
            [Action.LEFT if action is Action.RIGHT else action for action in log.actions()],
            [moment.distance_m for moment in log.moments],
        )
        for log in (teacher, drive)
    )
    return compare(taught, driven, (Action.FORWARD, Action.LEFT)).ssd
