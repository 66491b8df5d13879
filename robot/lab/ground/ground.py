"""Worlds that others made: how well does a robot drive after so many examples?"""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import numpy as np

from robot.lab.experiment import Experiment, ExperimentSettings, Plot, group
from robot.lab.ground.run import TEACHER
from robot.lab.ground.worlds import WORLDS
from robot.lab.tables import Cell, Table
from robot.lab.task import Result, Task

LEARNERS = (
    *("default-32", "published-32", "linear-alone-32", "fair-knn-9", "eyes-32"),
    *("mlp-64", "cnn-32"),
)
WAYS = ("corrections", "demonstration", "asked")
COUNTS = (100, 250, 400)
FIRST_SEED = 3000
_QUICK_WORLDS = ("Sidewalk", "ViZDoom")
_DRAWS = 2000
"""Of the bootstrap that the intervals come from."""


class Ground(Experiment):
    """Each learner in each world, taught in each way."""

    name = "ground"
    title = "Worlds that others made"
    text = (
        "MiniWorld (score: share of drives that reach the red box), CarRacing (percent of the "
        "track's tiles in 150 decisions), ViZDoom (tics survived, of 2,100). After 50 examples "
        "by demonstration the robot drives: with 'corrections' the teacher takes the wheel when it "
        "was wrong twice running; 'asked' only when the robot asks. In brackets the 95 % interval "
        "of the mean over seeds (bootstrap)."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan every world, learner, way and seed; the teacher once a world and seed."""
        learners = settings.learners or (LEARNERS[:2] if settings.quick else LEARNERS)
        ways = WAYS[:1] if settings.quick else WAYS
        runs = [(TEACHER, ""), *((learner, way) for learner in learners for way in ways)]
        return [
            Task(
                kind="ground",
                params={
                    "world": world,
                    "learner": learner,
                    "way": way,
                    "seed": FIRST_SEED + seed,
                    "counts": list(COUNTS),
                    "drives": 5 if settings.quick else 10,
                },
            )
            for world in settings.worlds or (_QUICK_WORLDS if settings.quick else tuple(WORLDS))
            for learner, way in runs
            for seed in range(2 if settings.quick else settings.n_seeds)
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table a world."""
        grouped = group(tasks, results, "world", "learner", "way")
        columns = ("", "runs", *(f"after {count}" for count in COUNTS), "taken over", "examples")
        return [
            Table(
                title=str(world),
                columns=columns,
                rows=tuple(
                    _row(f"{learner}, {way}" if way else str(learner), runs)
                    for (place, learner, way), runs in grouped.items()
                    if place == world
                ),
            )
            for world in dict.fromkeys(place for place, *_ in grouped)
        ]

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return two plots a world: the score over examples, and over takeovers."""
        grouped = group(tasks, results, "world", "learner", "way")
        return [
            Plot(
                title=str(world),
                x_label=x_label,
                y_label="score",
                series=tuple(
                    (f"{learner}, {way}", _means(runs, key), _means(runs, "score"))
                    for (place, learner, way), runs in grouped.items()
                    if place == world and way and (key == "examples" or way != "demonstration")
                ),
            )
            for world in dict.fromkeys(place for place, *_ in grouped)
            for key, x_label in (("examples", "examples"), ("takeovers", "takeovers"))
        ]


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval of the mean of some runs, by bootstrap; the same on every call."""
    sample = np.asarray(values, dtype=float)
    draws = np.random.default_rng(0).choice(sample, (_DRAWS, sample.size)).mean(axis=1)
    low, high = np.quantile(draws, (0.025, 0.975))
    return float(low), float(high)


def _row(name: str, runs: Sequence[Result]) -> tuple[Cell, ...]:
    cells: list[Cell] = []
    for stages in zip(*(run["stages"] for run in runs), strict=True):
        scores = [statistics.fmean(stage["scores"]) for stage in stages]
        low, high = interval(scores)
        cells.append(f"{statistics.fmean(scores):.2f} [{low:.2f}, {high:.2f}]")
    last = [run["stages"][-1] for run in runs]
    return (name, len(runs), *cells, *(_mean(last, key) for key in ("takeovers", "examples")))


def _means(runs: Sequence[Result], key: str) -> tuple[float, ...]:
    return tuple(
        statistics.fmean(statistics.fmean(s["scores"]) for s in stages)
        if key == "score"
        else statistics.fmean(stage[key] for stage in stages)
        for stages in zip(*(run["stages"] for run in runs), strict=True)
    )


def _mean(stages: Sequence[Result], key: str) -> float | None:
    return statistics.fmean(stage[key] for stage in stages) if key in stages[0] else None
