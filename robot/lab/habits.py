"""The experiment that a release must pass: many kinds of pilots teach robots, in many places, at
many frame rates."""

from __future__ import annotations

import random
import statistics
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, product
from typing import Any

from robot.lab import metrics
from robot.lab.chance import difference_by_chance
from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group
from robot.lab.ideas import make_learner
from robot.lab.metrics import DriveLog
from robot.lab.simulated_pilots.habits import HABITS, Habit
from robot.lab.simulated_pilots.pilot import SimulatedPilot
from robot.lab.tables import Columns, mean_percent, of, percent, tables_of
from robot.lab.task import Params, Result, Task
from robot.lab.trial import Trial, drive_by_hand
from robot.study.profile import compare
from robot.study.table import Cell, Table
from robot.types import Action, Mode

WORLDS = ("box", "office", "corridor", "fork", "clutter")
RATES_HZ = (10.0, 15.0, 30.0)
LONG_S, SHORT_S = 90.0, 30.0
CORRECT_S = 60.0
FIRST_SEED = 400
QUICK = [
    {"habit": "irregular", "world": "fork", "rate_hz": 30.0, "teach_s": SHORT_S},
    {"habit": "wall", "world": "office", "rate_hz": 10.0, "teach_s": SHORT_S},
    {"habit": "sloppy", "world": "box", "rate_hz": 15.0, "teach_s": SHORT_S},
]


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan a task for every habit in every place at every rate, each with a seed of its own."""
    times_s = (*((rate_hz, LONG_S) for rate_hz in RATES_HZ), (30.0, SHORT_S))
    chosen = [
        {"habit": habit, "world": world, "rate_hz": rate_hz, "teach_s": teach_s}
        for habit, world, (rate_hz, teach_s) in product(HABITS, WORLDS, times_s)
    ]
    # Run the cases in random order. If the experiment is interrupted, the cases already run are
    # then a random sample of all cases.
    random.Random(0).shuffle(chosen)
    chosen *= max(1, settings.n_seeds // 10)
    for number, case in enumerate(QUICK if settings.quick else chosen):
        params = {
            **case,
            "correct_s": CORRECT_S if number % 4 == 0 and not settings.quick else 0.0,
            "alone_s": 60.0,
            "learner": settings.learner,
            "seed": FIRST_SEED + (0 if settings.quick else number),
        }
        yield Task(run_habit, params)


def _tables(runs: Runs) -> list[Table]:
    """Return a table of the release criteria, then a table by rate, one by habit and one by place.

    The tables show lessons of 90 s, which `--quick` omits.
    """
    tables = [_gate(runs)]
    for name in ("rate_hz", "habit", "world"):
        drives = (
            (f"After 90 s of teaching, by {name}", str(task.params[name]), drive)
            for task, result in runs
            for drive in _drives([result])
            if task.params["teach_s"] > 60
        )
        tables += tables_of(drives, _COLUMNS, name)
    return tables


def _drives(results: Iterable[Result], phases: Sequence[str] = ("before", "after")) -> list[Result]:
    """Return the measures of each unaided drive of some runs, with the teacher's measures under
    `teacher`."""
    return [result[phase] for result in results for phase in phases if phase in result]


def _share(drives: Sequence[Result], name: str) -> float:
    """Sum a measure over all drives of the robots, and over all drives of their teachers. Return
    the ratio of the two sums; 0 if the teachers' sum is 0."""
    whole = float(sum(own["teacher"][name] for own in drives))
    return float(sum(own[name] for own in drives)) / whole if whole else 0.0


_COLUMNS: Columns = {
    "drives": len,
    "stuck": of("stuck", sum),
    "longest push s": of("longest_push_s", max),
    "asked": of("asking_share", mean_percent),
    "metres": lambda drives: percent(_share(drives, "driven_m")),
    "floor": lambda drives: percent(_share(drives, "covered_m2")),
    "SSD, median": of("ssd_alike", statistics.median),
    "SSD 75 %": of("ssd_alike", lambda s: statistics.quantiles(s, n=4)[-1] if s[1:] else None),
    "teacher's own SSD": of("teacher.ssd_alike", statistics.median),
    "SSD with sides, median": of("ssd_frequent", statistics.median),
}


def _gate(runs: Runs) -> Table:
    everyone = _drives(result for _, result in runs)
    pushes_s = [(own["longest_push_s"], own["teacher"]["longest_push_s"]) for own in everyone]
    stuck = sum(own["stuck"] for own in everyone) / len(everyone)
    rows: list[tuple[Cell, ...]] = [
        ("robots", "at least 240", len(runs)),
        ("stuck", "at most 1 %", percent(stuck, 1)),
        ("longest push", "at most 1 s", max(own_s for own_s, _ in pushes_s)),
        (
            "pushes over 1 s",
            "",
            sum(own_s > 1.0 and taught_s < 1.0 for own_s, taught_s in pushes_s),
        ),
        ("floor", "at least 90 %", percent(_share(everyone, "covered_m2"))),
        ("metres", "at least 85 %", percent(_share(everyone, "driven_m"))),
    ]
    for teach_s, asked in ((LONG_S, "8 %"), (SHORT_S, "15 %")):
        taught = [result for task, result in runs if task.params["teach_s"] == teach_s]
        shares = [own["asking_share"] for own in _drives(taught, ("before",))]
        if shares:
            rows.append((f"asks after {teach_s:.0f} s", f"at most {asked}", mean_percent(shares)))
    ssds = {
        rate_hz: [result["before"]["ssd_alike"] for result in results]
        for (rate_hz, teach_s), results in group(runs, "rate_hz", "teach_s").items()
        if teach_s == LONG_S
    }
    if {10.0, 30.0} <= ssds.keys():
        slow, fast = statistics.median(ssds[10.0]), statistics.median(ssds[30.0])
        rows.append(("median SSD at 30 Hz", f"at most {slow:.2f} (10 Hz)", fast))
        least, most = difference_by_chance(ssds[30.0], ssds[10.0])
        rows.append(("its difference by chance", "", f"{least:+.2f} to {most:+.2f}"))
    return Table(title="The gate", columns=("what", "asked", "measured"), rows=tuple(rows))


_MEANS = ("driven_m", "covered_m2", "steering_per_s")
DRIFT_SHARE = 0.15
"""Standard deviation of the drift of the wheels' speeds while a simulated pilot teaches, as a share
of the speed. On a straight drive, the heading then changes at random, with a standard deviation of
17 degrees a second."""


def run_habit(params: Params) -> Result:
    """Run one robot of this experiment: teach it, let it drive unaided, correct it, let it drive
    unaided again. For comparison, the pilot then drives from where the robot began to drive.

    One minute is too short to drive through the whole place, so drives from different starting
    points would differ. The pilot also drives at the frame rate of the lesson: with ten pictures a
    second a pilot reacts later than with thirty, and therefore follows a wall differently.

    Parameters: `habit`, `world`, `learner`, `rate_hz`, `seed`, `teach_s`, `correct_s`, `alone_s`,
    `reference_s`.
    """
    habit, name = HABITS[params["habit"]], f"{params['habit']} {params['seed']}"
    with taught_by(habit, name, params) as trial:
        taught, drives = trial.lesson(params["teach_s"], params["correct_s"], params["alone_s"])
    n_minutes = round(params.get("reference_s", 180.0) / 60.0)
    result: Result = {
        phase: beside_pilot(drive, taught, habit, name, params, n_minutes)
        for phase, drive in drives.items()
    }
    return {**result, "timing": trial.timing}


def taught_by(habit: Habit, name: str, params: Params) -> Trial:
    """Return a trial with a pilot of this habit. `name` seeds the pilot's random numbers."""
    policy, rate_hz = make_learner(params["learner"], habit.moves), params["rate_hz"]
    world, seed, pilot = params["world"], params["seed"], habit.pilot(name)
    return Trial(world, seed, policy, pilot, rate_hz=rate_hz, drift=DRIFT_SHARE)


def beside_pilot(
    drive: DriveLog, taught: DriveLog, habit: Habit, name: str, params: Params, n_minutes: int
) -> dict[str, Any]:
    """Return the measures of a robot's drive, and of its pilot's drives from the same start.

    Pushes in the lesson count as the pilot's, too, because the robot may have learned them there.
    """
    minutes = [
        drive_by_hand(
            params["world"],
            params["seed"] + 1000 * i,
            habit.pilot(f"{name} {i}"),
            60.0,
            params["rate_hz"],
            start=drive[0].pose,
        )
        for i in range(n_minutes)
    ]
    pilot = DriveLog(chain(*minutes))
    each = [metrics.figures(minute) for minute in minutes]
    teacher = {name: statistics.fmean(own[name] for own in each) for name in _MEANS}
    teacher["longest_push_s"] = max(metrics.longest_push_s(log) for log in (taught, *minutes))
    teacher["ssd_of_lesson"] = _ssd_of_turns_alike(taught, pilot)
    teacher["ssd_alike"] = statistics.fmean(_ssd_of_turns_alike(own, pilot) for own in minutes)
    return {
        **metrics.against(drive, pilot, habit.moves),
        "ssd_alike": _ssd_of_turns_alike(drive, pilot),
        "teacher": teacher,
    }


def ssd_in_place(drive: DriveLog, pilot: SimulatedPilot) -> float:
    """Compare a drive with the moves that the pilot would have made in the same situations. Return
    the sum of squared differences (SSD).

    A pilot who drives in curves soon circles in one place. If robot and pilot drove separately,
    they would circle in different places, and therefore make different moves. Compared in the same
    situations, they differ only in their moves.
    """
    pilot.change_mode(Mode.TRAIN)
    held = DriveLog()
    for moment in drive:
        if moment.situation is not None:
            command = pilot.act(moment.situation, None)
            held.append(replace(moment, action=command.held or Action.STOP, point=command.point))
    return _ssd_of_turns_alike(drive, held)


def _ssd_of_turns_alike(drive: DriveLog, teacher: DriveLog) -> float:
    """Return the sum of squared differences (SSD), with left and right counted as one move. Pilot
    and robot often choose the side by chance."""
    alike = (
        [replace(at, action=Action.LEFT) if at.action is Action.RIGHT else at for at in log]
        for log in (teacher, drive)
    )
    taught, driven = (DriveLog(log).profile() for log in alike)
    return compare(taught, driven, (Action.FORWARD, Action.LEFT)).ssd


GATE = Experiment(
    title="Habits: every kind of pilot",
    text="Each robot is taught by one of twelve kinds of pilots in one of five places at 10, 15 or "
    "30 frames a second. It is taught for 90 s, or for 30 s in half of the runs at 30 frames a "
    "second, and then drives for 60 s unaided. Every fourth robot is then corrected for 60 s, "
    "and drives unaided again. For comparison the pilot drives for three minutes from where the "
    "robot began its minute; the robot does not learn from them. A robot is stuck if it stays "
    "within 15 cm for 20 s. SSD counts left and right as one move, because the side is often "
    "chosen by chance. 'SSD with sides' is the published sum without moves that both make on "
    "less than 5 % of the ticks. 'by chance' is the 90 % bootstrap interval of the difference "
    "between the two medians.",
    plan=_plan,
    tables=_tables,
)
