"""Does "ready" mean ready? Forty pilots follow the page's hints; then the robot drives a minute."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from robot.lab.experiment import Experiment, ExperimentSettings
from robot.lab.habits import RATES_HZ, WORLDS
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.tables import Cell, Table
from robot.lab.task import Result, Task

PILOTS = 40
IN_TIME_S = 240.0
LIMIT_S = 1200.0
FIRST_SEED = 700


class Ready(Experiment):
    """What a robot that was called ready does in the minute after."""

    name = "ready"
    title = "Ready means ready"
    text = (
        "Pilots of all habits in all places teach, let the robot try with a hand near, and teach "
        "again, as robot/control/readiness.py says, for twenty minutes at most. Then it drives a "
        "minute alone."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan one run for each pilot; ten `seeds` are forty pilots."""
        habits = list(HABITS)
        return [
            Task(
                kind="ready",
                params={
                    "habit": habits[number % len(habits)],
                    "world": WORLDS[(number + number // len(habits)) % len(WORLDS)],
                    "rate_hz": RATES_HZ[(number + number // len(habits)) % len(RATES_HZ)],
                    "learner": settings.learners[0] if settings.learners else "default-32",
                    "seed": FIRST_SEED + number,
                    "in_time_s": IN_TIME_S,
                    "limit_s": LIMIT_S,
                },
            )
            for number in range(2 if settings.quick else PILOTS * max(1, settings.n_seeds // 10))
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table: those called ready in time, those called ready later, the others."""
        groups: dict[str, list[Result]] = {"within four minutes": [], "later": [], "never": []}
        for result in results:
            groups[_when(result)].append(result)
        rows: list[tuple[Cell, ...]] = [
            (when, *_cells(runs)) for when, runs in groups.items() if runs
        ]
        return [
            Table(title="The minute after", columns=("called ready", *_COLUMNS), rows=tuple(rows))
        ]


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


def _cells(runs: Sequence[Result]) -> tuple[Cell, ...]:
    asked = [run["asking_share"] for run in runs]
    return (
        len(runs),
        sum(bool(run["missing"]) for run in runs),
        statistics.median(run["taught_s"] + run["tried_s"] for run in runs),
        f"{100 * statistics.fmean(asked):.1f} %",
        f"{100 * max(asked):.1f} %",
        sum(share >= 0.05 for share in asked),
        max(run["longest_push_s"] for run in runs),
        sum(run["longest_push_s"] > 1.0 for run in runs),
        sum(run["stuck"] for run in runs),
        statistics.fmean(run["agreement"] or 0.0 for run in runs),
    )
