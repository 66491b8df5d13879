"""Experiment: does a robot drive more smoothly if its pilot steers proportionally than if the pilot
can only choose moves?"""

from __future__ import annotations

import statistics
from collections.abc import Iterable
from itertools import product

from robot.lab.chance import mean_in_interval
from robot.lab.experiment import Experiment, ExperimentSettings, Runs, seeded
from robot.lab.habits import beside_pilot, ssd_in_place, taught_by
from robot.lab.simulated_pilots.habits import HABITS, STEERED
from robot.lab.tables import Columns, of, tables_of
from robot.lab.task import Params, Result, Task
from robot.study.table import Table
from robot.types import Mode

PLACES = ("box", "office", "corridor")
WAYS = ("degrees", "cut to moves", "regular")
TEACH_S, CORRECT_S, ALONE_S = 90.0, 60.0, 60.0
RATE_HZ = 10.0
_MINUTES = 2
FIRST_SEED = 500


def _plan(settings: ExperimentSettings) -> Iterable[Task]:
    cases = (
        {"world": world, "way": way, "learner": settings.learner}
        for world, way in product(PLACES[:1] if settings.quick else PLACES, WAYS)
    )
    return seeded(run_degrees, cases, settings, first=FIRST_SEED)


def run_degrees(params: Params) -> Result:
    """Teach, correct, and drive unaided. Parameters: `world`, `way`, `learner`, `seed`."""
    habit, name = {**HABITS, **STEERED}[params["way"]], f"degrees {params['seed']}"
    params = {**params, "rate_hz": RATE_HZ}
    with taught_by(habit, name, params) as trial:
        taught = trial.drive(Mode.TRAIN, TEACH_S)
        trial.drive(Mode.AUTONOMOUS, CORRECT_S)
        alone = trial.drive(Mode.AUTONOMOUS, ALONE_S, supervised=False)
    return {
        **beside_pilot(alone, taught, habit, name, params, _MINUTES),
        "ssd_in_place": ssd_in_place(alone, habit.pilot(name)),
        "timing": trial.timing,
    }


def _tables(runs: Runs) -> list[Table]:
    places = [(task.params["world"], task.params["way"], result) for task, result in runs]
    all_places = [("all places", way, result) for _, way, result in places]
    return tables_of([*places, *all_places], _COLUMNS)


_COLUMNS: Columns = {
    "robots": len,
    "SSD in its place": of("ssd_in_place", mean_in_interval),
    "SSD, median": of("ssd_alike", statistics.median),
    "SSD": of("ssd_alike", mean_in_interval),
    "that of the lesson": of("teacher.ssd_of_lesson", mean_in_interval),
    "steering a second": of("steering_per_s", mean_in_interval),
    "pilot's own": of("teacher.steering_per_s", statistics.fmean),
    "metres": of("driven_m", mean_in_interval),
    "pilot's own m": of("teacher.driven_m", statistics.fmean),
    "longest push s": of("longest_push_s", max),
    "stuck": of("stuck", sum),
    "asked": of("asking_share", statistics.fmean),
}


PROPORTIONAL = Experiment(
    title="Proportional steering",
    text="A pilot who steers proportionally teaches for 90 s and corrects for 60 s; then the robot "
    "drives for 60 s unaided. 'cut to moves': this pilot's steering is rounded to moves, as for "
    "a body that accepts only moves. 'regular': a pilot who chooses moves. SSD counts left and "
    "right as one move. It is measured against what the pilot would have done in the robot's "
    "place at each tick, and against two minutes that the pilot drives from where the robot "
    "began. For comparison with the second SSD, the table has that of the pilot's own lesson: a "
    "pilot who drives in curves stays in one corner. Steering a second: root mean square of "
    "its changes; full lock is 1. In brackets: the 95 % interval of the mean over robots "
    "(bootstrap).",
    plan=_plan,
    tables=_tables,
)
