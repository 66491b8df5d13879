"""One pilot who steers by degrees: is his robot smoother than one that takes moves alone?"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence

from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group
from robot.lab.habit_run import DRIFT_SHARE, beside_pilot, pilots_minutes
from robot.lab.ideas import make_learner
from robot.lab.simulated_pilots.habits import HABITS, STEERED
from robot.lab.tables import mean_in_interval
from robot.lab.task import Params, Result, Task
from robot.lab.trial import Trial
from robot.store.table import Cell, Table
from robot.types import Mode

PLACES = ("box", "office", "corridor")
WAYS = ("degrees", "cut to moves", "regular")
TEACH_S, CORRECT_S, ALONE_S = 90.0, 60.0, 60.0
RATE_HZ = 10.0
_MINUTES = 2
FIRST_SEED = 500


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    learner = settings.learners[0] if settings.learners else "default-32"
    for seed in range(settings.n_seeds):
        for world in PLACES[:1] if settings.quick else PLACES:
            for way in WAYS:
                params = {"world": world, "way": way, "learner": learner, "seed": FIRST_SEED + seed}
                yield Task(run_degrees, params)


def run_degrees(params: Params) -> Result:
    """Teach, correct, and drive alone. Parameters: `world`, `way`, `learner`, `seed`."""
    habit = {**HABITS, **STEERED}[params["way"]]
    world, seed = params["world"], params["seed"]
    name, learner = f"degrees {seed}", make_learner(params["learner"], habit.moves)
    with Trial(
        world, seed, learner, habit.pilot(name), rate_hz=RATE_HZ, drift=DRIFT_SHARE
    ) as trial:
        taught = trial.drive(Mode.TRAIN, TEACH_S)
        trial.drive(Mode.AUTONOMOUS, CORRECT_S)
        alone = trial.drive(Mode.AUTONOMOUS, ALONE_S, supervised=False)
        timing = trial.timing()
    minutes = pilots_minutes(habit, name, world, seed, RATE_HZ, _MINUTES, alone)
    return {**beside_pilot(alone, minutes, taught, habit.moves), "timing": timing}


_COLUMNS = ("robots", "SSD, median", "SSD", "steering a second", "pilot's own", "metres")
_PUSHES = ("pilot's own m", "longest push s", "stuck", "asked")


def _tables(runs: Runs) -> list[Table]:
    """Return one table a place, and one of all."""
    rows: dict[str, list[tuple[Cell, ...]]] = {}
    for (world, way), results in group(runs, "world", "way").items():
        rows.setdefault(world, []).append((way, *_cells(results)))
    for (way,), results in group(runs, "way").items():
        rows.setdefault("all places", []).append((way, *_cells(results)))
    columns = ("", *_COLUMNS, *_PUSHES)
    return [Table(title=title, columns=columns, rows=tuple(own)) for title, own in rows.items()]


def _cells(results: Sequence[Result]) -> tuple[Cell, ...]:
    def of(name: str) -> list[float]:
        return [float(result[name]) for result in results]

    def own(name: str) -> float:
        return statistics.fmean(result["teacher"][name] for result in results)

    return (
        len(results),
        statistics.median(of("ssd_alike")),
        mean_in_interval(of("ssd_alike")),
        mean_in_interval(of("steering_per_s")),
        own("steering_per_s"),
        mean_in_interval(of("driven_m")),
        own("driven_m"),
        max(of("longest_push_s")),
        sum(of("stuck")),
        statistics.fmean(of("asking_share")),
    )


BY_DEGREES = Experiment(
    title="By degrees",
    text="A pilot who steers by degrees teaches for 90 s and corrects for 60 s; then the robot "
    "drives for 60 s alone. 'cut to moves': what he means is cut to moves, as for a body that "
    "takes no degrees. 'regular': a pilot of moves. SSD with left and right as one move, "
    "against two minutes of the pilot himself from where the robot began; steering a second: root "
    "mean square of its changes, full lock being 1. In brackets the 95 % interval of the mean "
    "over robots (bootstrap).",
    plan=_plan,
    tables=_tables,
)
