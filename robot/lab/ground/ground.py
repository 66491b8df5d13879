"""Worlds that others made: how well does a robot drive after so many examples?"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from itertools import product

from robot.lab.experiment import Experiment, ExperimentSettings, Plot, Runs, group
from robot.lab.ground.run import TEACHER, run_ground
from robot.lab.ground.worlds import WORLDS
from robot.lab.tables import mean_in_interval
from robot.lab.task import Result, Task
from robot.store.table import Cell, Table

LEARNERS = (
    *("default-32", "published-32", "linear-alone-32", "fair-knn-9", "eyes-32"),
    *("mlp-64", "cnn-32"),
)
WAYS = ("corrections", "demonstration", "asked")
COUNTS = (100, 250, 400)
FIRST_SEED = 3000
_QUICK_WORLDS = ("Sidewalk", "ViZDoom")


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan every world, learner, way and seed; the teacher once a world and seed."""
    learners = settings.learners or (LEARNERS[:2] if settings.quick else LEARNERS)
    ways = WAYS[:1] if settings.quick else WAYS
    for world in settings.worlds or (_QUICK_WORLDS if settings.quick else tuple(WORLDS)):
        for learner, way in ((TEACHER, ""), *product(learners, ways)):
            for seed in range(2 if settings.quick else settings.n_seeds):
                yield ground_task(world, learner, way, seed, drives=5 if settings.quick else 10)


def ground_task(
    world: str,
    learner: str,
    way: str,
    seed: int,
    *,
    counts: Sequence[int] = COUNTS,
    drives: int = 10,
) -> Task:
    """Return one run: how a learner was taught, and how often it then drives alone."""
    params = {
        "world": world,
        "learner": learner,
        "way": way,
        "seed": FIRST_SEED + seed,
        "counts": list(counts),
        "drives": drives,
    }
    return Task(run_ground, params)


def _by_world(runs: Runs) -> dict[str, dict[tuple[str, str], list[Result]]]:
    """Return the runs of each learner and way, by world."""
    worlds: dict[str, dict[tuple[str, str], list[Result]]] = {}
    for (world, learner, way), results in group(runs, "world", "learner", "way").items():
        worlds.setdefault(world, {})[learner, way] = results
    return worlds


def _tables(runs: Runs) -> list[Table]:
    columns = ("", "runs", *(f"after {count}" for count in COUNTS), "taken over", "examples")
    return [
        Table(
            title=world,
            columns=columns,
            rows=tuple(
                _row(f"{learner}, {way}" if way else learner, results)
                for (learner, way), results in ways.items()
            ),
        )
        for world, ways in _by_world(runs).items()
    ]


def _plots(runs: Runs) -> list[Plot]:
    """Return two plots a world: the score over examples, and over takeovers."""
    return [
        Plot(
            title=world,
            x_label=x_label,
            y_label="score",
            series=[
                (f"{learner}, {way}", _means(results, x_label), _mean_scores(results))
                for (learner, way), results in ways.items()
                if way and (x_label == "examples" or way != "demonstration")
            ],
        )
        for world, ways in _by_world(runs).items()
        for x_label in ("examples", "takeovers")
    ]


def scores_by_stage(results: Sequence[Result]) -> list[list[float]]:
    """Return the mean score of each run, by number of examples."""
    return [
        [statistics.fmean(stage["scores"]) for stage in stages]
        for stages in zip(*(result["stages"] for result in results), strict=True)
    ]


def _row(name: str, results: Sequence[Result]) -> tuple[Cell, ...]:
    cells = map(mean_in_interval, scores_by_stage(results))
    has_examples = "examples" in results[0]["stages"][-1]
    last = [_means(results, key)[-1] if has_examples else None for key in ("takeovers", "examples")]
    return (name, len(results), *cells, *last)


def _mean_scores(results: Sequence[Result]) -> tuple[float, ...]:
    return tuple(map(statistics.fmean, scores_by_stage(results)))


def _means(results: Sequence[Result], key: str) -> tuple[float, ...]:
    return tuple(
        statistics.fmean(stage[key] for stage in stages)
        for stages in zip(*(result["stages"] for result in results), strict=True)
    )


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
