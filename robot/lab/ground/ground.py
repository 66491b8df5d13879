"""Third-party worlds: measures how well a robot drives after a given number of examples."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np

from robot.lab.chance import mean_in_interval, mean_of_known
from robot.lab.experiment import Experiment, ExperimentSettings, Plot, Runs, group, seeded
from robot.lab.ground.run import TEACHER, run_ground
from robot.lab.ground.worlds import WORLDS
from robot.lab.tables import Columns, tables_of
from robot.lab.task import Result, Task
from robot.study.table import Table

LEARNERS = (
    *("default-32", "published-32", "linear-alone-32", "fair-knn-9", "eyes-32"),
    *("mlp-64", "cnn-32"),
)
WAYS = ("corrections", "demonstration", "asked")
COUNTS = (100, 250, 400)
FIRST_SEED = 3000
_QUICK_WORLDS = ("Sidewalk", "ViZDoom")


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan runs of every world with every learner and way of teaching, and with the world's own
    teacher. With `--quick` each combination is run twice."""
    learners = settings.learners or (LEARNERS[:2] if settings.quick else LEARNERS)
    worlds = settings.worlds or (_QUICK_WORLDS if settings.quick else tuple(WORLDS))
    drivers = [(TEACHER, ""), *product(learners, WAYS[:1] if settings.quick else WAYS)]
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
    name = "{learner}, {way}".format_map
    results = (
        (task.params["world"], name(task.params).removesuffix(", "), result)
        for task, result in runs
    )
    return tables_of(results, _COLUMNS)


def _plots(runs: Runs) -> list[Plot]:
    """Return two plots for each world: the score against the number of examples, and against the
    number of takeovers."""
    return [
        Plot(
            title=world,
            x_label=x_label,
            y_label="score",
            series=[
                (f"{learner}, {way}", _means(results, x_label), _means(results, "scores"))
                for (own, learner, way), results in group(runs, "world", "learner", "way").items()
                if own == world and way and (x_label == "examples" or way != "demonstration")
            ],
        )
        for (world,) in group(runs, "world")
        for x_label in ("examples", "takeovers")
    ]


def _means(results: Sequence[Result], name: str) -> list[float]:
    """Return the mean of a measure over the runs, at each stage."""
    stages = zip(*(result["stages"] for result in results), strict=True)
    return [float(np.mean([run[name] for run in own])) for own in stages]


def score_at(stage: int) -> Callable[[Sequence[Result]], str]:
    """Return a function that fills a cell of the table: the mean of the runs' scores at one
    stage."""
    return lambda results: mean_in_interval(
        [statistics.fmean(result["stages"][stage]["scores"]) for result in results]
    )


def _last(name: str) -> Callable[[Sequence[Result]], float | None]:
    """Return the function that computes a cell of the table: the mean of a measure at the last
    stage."""
    return lambda results: mean_of_known([result["stages"][-1].get(name) for result in results])


_COLUMNS: Columns = {
    "runs": len,
    **{f"after {count}": score_at(stage) for stage, count in enumerate(COUNTS)},
    "taken over": _last("takeovers"),
    "examples": _last("examples"),
}


GROUND = Experiment(
    title="Worlds that others made",
    text="MiniWorld (score: share of drives that reach the red box), CarRacing (percent of the "
    "track's tiles in 150 decisions), ViZDoom (tics survived, of 2,100). The robot drives "
    "after 50 examples by demonstration. With 'corrections' the teacher takes the wheel after "
    "two wrong decisions in succession, with 'asked' only when the robot asks. In brackets: "
    "the 95 % interval of the mean over seeds (bootstrap).",
    plan=_plan,
    tables=_tables,
    plots=_plots,
)
