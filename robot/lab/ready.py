"""Does "ready" mean ready? Forty pilots follow the page's hints; then the robot drives a minute."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence

from robot.lab.experiment import Experiment, ExperimentSettings, Runs
from robot.lab.habits import RATES_HZ, WORLDS
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.tables import percent
from robot.lab.task import Result, Task
from robot.store.table import Cell, Table

PILOTS = 40
IN_TIME_S = 240.0
LIMIT_S = 1200.0
FIRST_SEED = 700


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan one run for each pilot; ten `seeds` are forty pilots."""
    habits = list(HABITS)
    for number in range(2 if settings.quick else PILOTS * max(1, settings.n_seeds // 10)):
        turn = number + number // len(habits)
        params = {
            "habit": habits[number % len(habits)],
            "world": WORLDS[turn % len(WORLDS)],
            "rate_hz": RATES_HZ[turn % len(RATES_HZ)],
            "learner": settings.learners[0] if settings.learners else "default-32",
            "seed": FIRST_SEED + number,
            "in_time_s": IN_TIME_S,
            "limit_s": LIMIT_S,
        }
        yield Task("ready", params)


def _tables(runs: Runs) -> list[Table]:
    """Return one table: those called ready in time, those called ready later, the others."""
    groups: dict[str, list[Result]] = {"within four minutes": [], "later": [], "never": []}
    for _, result in runs:
        groups[_when(result)].append(result)
    rows = tuple((when, *_cells(results)) for when, results in groups.items() if results)
    return [Table(title="The minute after", columns=("called ready", *_COLUMNS), rows=rows)]


_COLUMNS = (
    *("runs", "told what is missing", "taught and tried s, median"),
    *("asked, mean", "asked, most", "asked 5 % or more"),
    *("longest push s", "pushed over 1 s", "stuck", "agreement, mean"),
)


def _when(result: Result) -> str:
    if not result["is_ready"]:
        return "never"
    is_in_time = round(result["taught_s"] + result["tried_s"]) <= IN_TIME_S
    return "within four minutes" if is_in_time else "later"


def _cells(results: Sequence[Result]) -> tuple[Cell, ...]:
    asked = [result["asking_share"] for result in results]
    pushes_s = [result["longest_push_s"] for result in results]
    return (
        len(results),
        sum(bool(result["missing"]) for result in results),
        statistics.median(result["taught_s"] + result["tried_s"] for result in results),
        percent(statistics.fmean(asked), 1),
        percent(max(asked), 1),
        sum(share >= 0.05 for share in asked),
        max(pushes_s),
        sum(push_s > 1.0 for push_s in pushes_s),
        sum(result["stuck"] for result in results),
        statistics.fmean(result["agreement"] or 0.0 for result in results),
    )


READY = Experiment(
    name="ready",
    title="Ready means ready",
    text="Pilots of all habits in all places teach, let the robot try with a hand near, and teach "
    "again, as robot/control/readiness.py says, for twenty minutes at most. Then it drives a "
    "minute alone.",
    plan=_plan,
    tables=_tables,
)
