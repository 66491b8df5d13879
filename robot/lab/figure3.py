"""Figure 3: trained on 700 frames of one drive, tested on 700 of another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from robot.lab.experiment import Experiment, ExperimentSettings, Plot, Runs, group
from robot.lab.footage import recorded_pairs
from robot.lab.lessons import TRIALS
from robot.lab.published import FIGURE_3
from robot.lab.tables import spread
from robot.lab.task import Result, Task
from robot.store.table import Cell, Table

LEARNERS = ("knn-3", "knn-9", "published-32", "published-64", "published-128", "default-32")
KINDS = {"simulated_footage": "Simulated", "recorded_footage": "Recorded"}


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan every learner on every place and seed, and on every pair of recordings."""
    learners = settings.learners or LEARNERS
    for number, trial in TRIALS.items():
        for learner in learners:
            for seed in range(settings.n_seeds):
                params = {**trial, "trial": number, "learner": learner, "seed": seed}
                yield Task("simulated_footage", params)
    pairs = recorded_pairs(Path(settings.recordings)) if settings.recordings else []
    for train, test in pairs[:2] if settings.quick else pairs:
        for learner in learners:
            if ":" not in learner:
                yield Task("recorded_footage", {"train": train, "test": test, "learner": learner})


def _tables(runs: Runs) -> list[Table]:
    by_kind = {kind: [run for run in runs if run[0].kind == kind] for kind in KINDS}
    return [
        Table(
            title=f"{KINDS[kind]} footage: correct of 700",
            columns=(
                *("learner", "pairs", "mean", "sd", "accuracy", "balanced"),
                *("paper mean", "paper sd"),
            ),
            rows=tuple(_row(key[0], results) for key, results in group(mine, "learner").items()),
        )
        for kind, mine in by_kind.items()
        if mine
    ]


def _row(learner: str, results: Sequence[Result]) -> tuple[Cell, ...]:
    correct = spread([700 * result["accuracy"] for result in results])
    paper: tuple[Cell, ...] = FIGURE_3.get(learner, (None, None))
    shares = (
        spread([result[name] for result in results]).mean
        for name in ("accuracy", "balanced_accuracy")
    )
    return (learner, correct.n, correct.mean, correct.sd, *shares, *paper)


def _plots(runs: Runs) -> list[Plot]:
    """Return mean correct by learner, beside the paper's."""
    ours = {
        learner: spread([result["correct"] for result in results]).mean
        for (learner,), results in group(runs, "learner").items()
    }
    paper = {learner: FIGURE_3[learner][0] for learner in ours if learner in FIGURE_3}
    series = [
        (name, tuple(means), tuple(means.values()))
        for name, means in (("here", ours), ("paper", paper))
    ]
    return [Plot(title="Correct of 700", y_label="frames", series=series)]


FIGURE3 = Experiment(
    name="figure3",
    title="Figure 3: footage",
    text="Each learner sees 700 frames of one drive once, in order, and is tested on 700 of "
    "another drive of the same place. Simulated: two drives of a teacher with different "
    "starts, noise and slips of the hand, in the places of the three trials. Recorded: real "
    "cars driven by people, where a folder of recordings is given.",
    plan=_plan,
    tables=_tables,
    plots=_plots,
)
