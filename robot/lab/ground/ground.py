"""Worlds that others made: how well does a robot drive after so many examples?"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any

from robot.lab.experiment import Experiment, ExperimentSettings, Plot, Runs, group, seeded
from robot.lab.ground.run import TEACHER, run_ground
from robot.lab.ground.worlds import WORLDS
from robot.lab.tables import Columns, mean_in_interval, tables_of
from robot.lab.task import Result, Task
from robot.store.table import Table

LEARNERS = (
    *("default-32", "published-32", "linear-alone-32", "fair-knn-9", "eyes-32"),
    *("mlp-64", "cnn-32"),
)
WAYS = ("corrections", "demonstration", "asked")
COUNTS = (100, 250, 400)
FIRST_SEED = 3000
_QUICK_WORLDS = ("Sidewalk", "ViZDoom")


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan every world, learner and way, in the quick form twice; the teacher once a world."""
    learners = settings.learners or (LEARNERS[:2] if settings.quick else LEARNERS)
    ways = product(learners, WAYS[:1] if settings.quick else WAYS)
    worlds = settings.worlds or (_QUICK_WORLDS if settings.quick else tuple(WORLDS))
    drivers = [(TEACHER, ""), *ways]
    cases = (
        {
            "world": world,
            "learner": learner,
            "way": way,
            "counts": list(COUNTS),
            "drives": 5 if settings.quick else 10,
        }
        for world, (learner, way) in product(worlds, drivers)
    )
    return seeded(run_ground, cases, settings, first=FIRST_SEED, least=1 + settings.quick)


def _tables(runs: Runs) -> list[Table]:
    results = (
        (world, f"{learner}, {way}" if way else learner, result)
        for (world, learner, way), own in _by_way(runs).items()
        for result in own
    )
    return tables_of(results, _COLUMNS)


def _by_way(runs: Runs) -> dict[tuple[Any, ...], list[Result]]:
    return group(runs, "world", "learner", "way")


def _plots(runs: Runs) -> list[Plot]:
    """Return two plots a world: the score over examples, and over takeovers."""
    return [
        Plot(
            title=world,
            x_label=x_label,
            y_label="score",
            series=[
                (
                    f"{learner}, {way}",
                    [statistics.fmean(values) for values in by_stage(results, x_label)],
                    [statistics.fmean(values) for values in scores_by_stage(results)],
                )
                for (own, learner, way), results in _by_way(runs).items()
                if own == world and way and (x_label == "examples" or way != "demonstration")
            ],
        )
        for (world,), _ in group(runs, "world").items()
        for x_label in ("examples", "takeovers")
    ]


def by_stage(results: Sequence[Result], name: str) -> list[list[Any]]:
    """Return a figure of each run, by number of examples."""
    stages = zip(*(result["stages"] for result in results), strict=True)
    return [[stage[name] for stage in own] for own in stages]


def scores_by_stage(results: Sequence[Result]) -> list[list[float]]:
    """Return the mean score of each run, by number of examples."""
    return [list(map(statistics.fmean, scores)) for scores in by_stage(results, "scores")]


def _score(stage: int) -> Callable[[Sequence[Result]], str]:
    return lambda results: mean_in_interval(scores_by_stage(results)[stage])


def _last(name: str) -> Callable[[Sequence[Result]], float | None]:
    """Return how a cell is made of a figure of the last stage, which teachers have not."""
    return lambda results: (
        statistics.fmean(by_stage(results, name)[-1]) if name in results[0]["stages"][-1] else None
    )


_COLUMNS: Columns = {
    "runs": len,
    **{f"after {count}": _score(stage) for stage, count in enumerate(COUNTS)},
    "taken over": _last("takeovers"),
    "examples": _last("examples"),
}


GROUND = Experiment(
    title="Worlds that others made",
    text="MiniWorld (score: share of drives that reach the red box), CarRacing (percent of the "
    "track's tiles in 150 decisions), ViZDoom (tics survived, of 2,100). After 50 examples "
    "by demonstration the robot drives: with 'corrections' the teacher takes the wheel when it "
    "was wrong twice running; 'asked' only when the robot asks. In brackets the 95 % interval "
    "of the mean over seeds (bootstrap).",
    plan=_plan,
    tables=_tables,
    plots=_plots,
)
