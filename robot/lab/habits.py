"""The release gate: robots taught by many kinds of pilots, in many places, at many frame rates."""

from __future__ import annotations

import random
import statistics
from collections.abc import Callable, Sequence
from typing import Any

from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group
from robot.lab.habit_run import run_habit
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.tables import percent
from robot.lab.task import Result, Task
from robot.store.table import Cell, Table

WORLDS = ("box", "office", "corridor", "fork", "clutter")
RATES_HZ = (10.0, 15.0, 30.0)
LONG_S, SHORT_S = 90.0, 30.0
CORRECT_S = 60.0
FIRST_SEED = 400
_DRAWS = 1000
QUICK = (("irregular", "fork", 30.0), ("wall", "office", 10.0), ("sloppy", "box", 15.0))


def _plan(settings: ExperimentSettings) -> list[Task]:
    """Plan every habit in every place at every rate; the seed differs from task to task."""
    learner = settings.learners[0] if settings.learners else "default-32"
    if settings.quick:
        return [_task(*what, SHORT_S, 0.0, FIRST_SEED, learner) for what in QUICK]
    chosen = [
        (habit, world, rate_hz, teach_s)
        for habit in HABITS
        for world in WORLDS
        for rate_hz, teach_s in (*((rate_hz, LONG_S) for rate_hz in RATES_HZ), (30.0, SHORT_S))
    ]
    # In an order of chance, so that the runs done by any moment are a sample of all.
    random.Random(0).shuffle(chosen)
    return [
        _task(*what, CORRECT_S if number % 4 == 0 else 0.0, FIRST_SEED + number, learner)
        for number, what in enumerate(chosen * max(1, settings.n_seeds // 10))
    ]


def _task(
    habit: str,
    world: str,
    rate_hz: float,
    teach_s: float,
    correct_s: float,
    seed: int,
    learner: str,
) -> Task:
    params = {
        "habit": habit,
        "world": world,
        "rate_hz": rate_hz,
        "teach_s": teach_s,
        "correct_s": correct_s,
        "alone_s": 60.0,
        "learner": learner,
        "seed": seed,
    }
    return Task(run_habit, params)


def _tables(runs: Runs) -> list[Table]:
    """Return the release criteria, then one table each by rate, habit and place.

    The tables are of lessons of 90 s, of which the quick form has none.
    """
    long = [run for run in runs if run[0].params["teach_s"] > 60]
    return [
        _gate(runs),
        *(
            Table(
                title=f"After 90 s of teaching, by {name}",
                columns=(name, *_COLUMNS),
                rows=tuple(
                    (str(key[0]), *_cells(_drives(results)))
                    for key, results in group(long, name).items()
                ),
            )
            for name in (("rate_hz", "habit", "world") if long else ())
        ),
    ]


_Drive = tuple[dict[str, Any], dict[str, Any]]
"""Figures of a drive, and of its teacher."""


def _drives(results: Sequence[Result], phases: Sequence[str] = ("before", "after")) -> list[_Drive]:
    return [
        (result[phase], result[phase]["teacher"])
        for result in results
        for phase in phases
        if phase in result
    ]


_COLUMNS = (
    *("drives", "stuck", "longest push s", "asked", "metres", "floor"),
    *("SSD, median", "SSD 75 %", "teacher's own SSD", "SSD with sides, median"),
)


def _cells(drives: Sequence[_Drive]) -> tuple[Cell, ...]:
    robot = [own for own, _ in drives]
    alike = [own["ssd_alike"] for own in robot]
    return (
        len(drives),
        sum(own["stuck"] for own in robot),
        max(own["longest_push_s"] for own in robot),
        percent(statistics.fmean(own["asking_share"] for own in robot), 1),
        percent(_share(drives, "driven_m")),
        percent(_share(drives, "covered_m2")),
        statistics.median(alike),
        statistics.quantiles(alike, n=4)[-1] if alike[1:] else None,
        statistics.median(teacher["ssd_alike"] for _, teacher in drives),
        statistics.median(own["ssd_frequent"] for own in robot),
    )


def _share(drives: Sequence[_Drive], name: str) -> float:
    """Return the robots' sum as a share of their teachers'; 0 where they did nothing."""
    whole = float(sum(teacher[name] for _, teacher in drives))
    return float(sum(own[name] for own, _ in drives)) / whole if whole else 0.0


def _gate(runs: Runs) -> Table:

    def of(is_wanted: Callable[[float], bool], *phases: str) -> list[_Drive]:
        wanted = [result for task, result in runs if is_wanted(task.params["teach_s"])]
        return _drives(wanted, phases)

    everyone = of(lambda teach_s: True, "before", "after")
    pushes_s = [(own["longest_push_s"], teacher["longest_push_s"]) for own, teacher in everyone]
    stuck = sum(own["stuck"] for own, _ in everyone) / len(everyone)
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
    for name, asked, drives in (
        ("90 s", "8 %", of(lambda teach_s: teach_s > 60, "before")),
        ("30 s", "15 %", of(lambda teach_s: teach_s < 60, "before")),
    ):
        if drives:
            share = statistics.fmean(own["asking_share"] for own, _ in drives)
            rows.append((f"asks after {name}", f"at most {asked}", percent(share, 1)))
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
    name="habits",
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
