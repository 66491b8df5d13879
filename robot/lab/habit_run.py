"""One robot taught by one kind of pilot, and how it then drives beside that pilot."""

from __future__ import annotations

import statistics
from typing import Any

from robot.control.profile import behavior_profile, compare
from robot.devices.simulation.driver import SimDriver, SimOptions
from robot.lab.ideas import make_learner
from robot.lab.metrics import driving
from robot.lab.metrics.log import DriveLog, DriveSample
from robot.lab.simulated_pilots.habits import HABITS, Habit
from robot.lab.simulated_pilots.pilot import SimulatedPilot
from robot.lab.task import Params, Result
from robot.lab.trial import Place, Trial, drive_by_hand
from robot.testing import VirtualClock
from robot.types import Action, DrivenBy, Mode, Pose

_MEANS = ("driven_m", "covered_m2", "ssd", "ssd_frequent", "ssd_alike", "steering_per_s")
DRIFT_SHARE = 0.15
"""Drift of the wheels while a simulated pilot teaches. In a second of driving straight the heading
changes by 17 degrees (standard deviation)."""


def make_habit_pilot(habit: Habit, seed: str) -> SimulatedPilot:
    """Return the whole pilot: teacher, human delays and takeover."""
    return SimulatedPilot(
        habit.teacher(habit.turns, seed),
        (Action.FORWARD, *habit.turns),
        hand=habit.hand,
        takeover=habit.takeover,
        seed=seed,
    )


def run_habit(params: Params) -> Result:
    """Teach, drive alone, correct, drive alone again; and the pilot from where the robot began.

    Parameters: `habit`, `world`, `learner`, `rate_hz`, `seed`, `teach_s`, `correct_s`, `alone_s`,
    `reference_s`, `drift`.
    """
    habit = HABITS[params["habit"]]
    moves = (Action.FORWARD, *habit.turns)
    place = Place(world=params["world"], seed=params["seed"])
    name = f"{params['habit']} {params['seed']}"
    with Trial(
        place,
        make_learner(params["learner"], moves),
        make_habit_pilot(habit, name),
        rate_hz=params["rate_hz"],
        drift=params.get("drift", DRIFT_SHARE),
    ) as trial:
        alone_s = params.get("alone_s", 60.0)
        taught = trial.drive(Mode.TRAIN, params["teach_s"])
        drives = {"before": trial.drive(Mode.AUTONOMOUS, alone_s, supervised=False)}
        if params.get("correct_s"):
            trial.drive(Mode.AUTONOMOUS, params["correct_s"])
            drives["after"] = trial.drive(Mode.AUTONOMOUS, alone_s, supervised=False)
        timing, lessons = trial.timing(), dict(trial.loop.state.taught)
    n_minutes = round(params.get("reference_s", 180.0) / 60.0)
    result: Result = {}
    for phase, drive in drives.items():
        start = drive.moments[0].pose
        minutes = [
            minute_by_hand(
                place,
                make_habit_pilot(habit, f"{name} {number}"),
                number,
                start,
                rate_hz=params["rate_hz"],
            )
            for number in range(n_minutes)
        ]
        result[phase] = beside_pilot(drive, minutes, taught, moves)
    result["lessons"] = {move.value: n for move, n in sorted(lessons.items())}
    result["timing"] = timing
    return result


def beside_pilot(
    drive: DriveLog, minutes: list[DriveLog], taught: DriveLog, moves: tuple[Action, ...]
) -> dict[str, Any]:
    """Return the figures of a robot's minute, and those of its pilot's own minutes.

    A push counts as the pilot's in the lesson, too: there the robot learned it.
    """
    pilot = DriveLog([moment for minute in minutes for moment in minute.moments])
    each = [drive_figures(minute, pilot, moves) for minute in minutes]
    teacher = {
        key: statistics.fmean(float(figures[key]) for figures in each) for key in (*_MEANS, "stuck")
    }
    teacher["longest_push_s"] = max(driving.longest_push_s(log) for log in (taught, *minutes))
    return {**drive_figures(drive, pilot, moves), "teacher": teacher}


def drive_figures(drive: DriveLog, teacher: DriveLog, moves: tuple[Action, ...]) -> dict[str, Any]:
    """Return the figures of a minute's drive, beside all that its teacher drove."""
    return {
        **driving.against(drive, teacher, moves),
        "ssd_alike": _ssd_of_turns_alike(drive, teacher),
    }


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


def minute_by_hand(
    place: Place, pilot: SimulatedPilot, number: int, start: Pose, *, rate_hz: float
) -> DriveLog:
    """Return a drive of a minute in which the pilot drives and the robot learns nothing.

    It starts where the robot's own minute did: in a minute neither sees all of a place, and from
    another corner the difference would be that of the corners. And at the lesson's frame rate: with
    ten pictures a second a hand moves later than with thirty, and who follows a wall drives it
    otherwise.
    """
    clock = VirtualClock()
    driver = SimDriver(SimOptions(world=place.world, seed=place.seed + 1000 * number))
    driver.connect()
    driver.simulation.pose = start
    log = DriveLog()
    for situation, _ in drive_by_hand(driver, pilot, clock, 60.0, rate_hz):
        sensors, simulation = driver.sense(), driver.simulation
        log.add(
            DriveSample(
                now_s=situation.at_s,
                action=simulation.action,
                point=simulation.point,
                driven_by=DrivenBy.PILOT,
                distance_m=sensors.distance_m or 0.0,
                pose=sensors.pose or Pose(x_m=0.0, y_m=0.0, heading_rad=0.0),
                is_touching=simulation.is_touching,
                is_pushing=simulation.is_pushing,
            )
        )
    driver.disconnect()
    return log
