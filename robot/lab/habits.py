"""The release gate: robots taught by many kinds of pilots, in many places, at many frame rates."""

from __future__ import annotations

import random
import statistics
from collections.abc import Iterable, Iterator, Sequence
from itertools import product

from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group
from robot.lab.habit_run import run_habit
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.tables import Columns, mean_percent, of, percent, tables_of
from robot.lab.task import Result, Task
from robot.store.table import Cell, Table

WORLDS = ("box", "office", "corridor", "fork", "clutter")
RATES_HZ = (10.0, 15.0, 30.0)
LONG_S, SHORT_S = 90.0, 30.0
CORRECT_S = 60.0
FIRST_SEED = 400
_DRAWS = 1000
QUICK = [
    ("irregular", "fork", 30.0, SHORT_S),
    ("wall", "office", 10.0, SHORT_S),
    ("sloppy", "box", 15.0, SHORT_S),
]


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan every habit in every place at every rate; the seed differs from task to task."""
    times_s = (*((rate_hz, LONG_S) for rate_hz in RATES_HZ), (30.0, SHORT_S))
    chosen = [
        (habit, world, rate_hz, teach_s)
        for habit, world, (rate_hz, teach_s) in product(HABITS, WORLDS, times_s)
    ]
    # In an order of chance, so that the runs done by any moment are a sample of all.
    random.Random(0).shuffle(chosen)
    chosen *= max(1, settings.n_seeds // 10)
    for number, (habit, world, rate_hz, teach_s) in enumerate(QUICK if settings.quick else chosen):
        params = {
            "habit": habit,
            "world": world,
            "rate_hz": rate_hz,
            "teach_s": teach_s,
            "correct_s": CORRECT_S if number % 4 == 0 and not settings.quick else 0.0,
            "alone_s": 60.0,
            "learner": settings.learner,
            "seed": FIRST_SEED + (0 if settings.quick else number),
        }
        yield Task(run_habit, params)


def _tables(runs: Runs) -> list[Table]:
    """Return the release criteria, then one table each by rate, habit and place.

    The tables are of lessons of 90 s, of which the quick form has none.
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
    """Return the figures of each drive alone; those of its teacher are `teacher`."""
    return [result[phase] for result in results for phase in phases if phase in result]


def _share(drives: Sequence[Result], name: str) -> float:
    """Return the robots' sum as a share of their teachers'; 0 where they did nothing."""
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


def difference_by_chance(values: Sequence[float], others: Sequence[float]) -> tuple[float, float]:
    """Return where 90 % of the differences of the medians lie when all robots are drawn anew.

    A minute's SSD is half chance, so that medians of sixty robots differ by a fifth without cause.
    """
    draw = random.Random(0)
    differences = sorted(
        statistics.median(draw.choices(values, k=len(values)))
        - statistics.median(draw.choices(others, k=len(others)))
        for _ in range(_DRAWS)
    )
    rare = _DRAWS // 20
    return differences[rare], differences[-rare]


GATE = Experiment(
    title="Habits: every kind of pilot",
    text="Each robot is taught by one of twelve kinds of pilots in one of five places at 10, 15 or "
    "30 frames a second, for 90 s or (a third of those at 30) for 30 s, and drives 60 s alone; "
    "every fourth one is then corrected for 60 s and drives alone again. From where the robot "
    "began its minute the pilot drives three of his own, in which the robot learns nothing: "
    "that is what it is held against. "
    "stuck: within 15 cm for 20 s. SSD counts left and right as one move, because the side is "
    "often left to chance; the published sum stands beside it, moves that both make on less "
    "than 5 % of the ticks left out. By chance: where 90 % of the differences of two medians "
    "lie when all robots are drawn anew.",
    plan=_plan,
    tables=_tables,
)
