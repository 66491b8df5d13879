"""Figure 3: trained on 700 frames of one drive, tested on 700 of another."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robot.lab.experiment import Experiment, ExperimentSettings, Plot, group
from robot.lab.footage import recorded_pairs
from robot.lab.lessons import TRIALS
from robot.lab.published import FIGURE_3
from robot.lab.tables import Cell, Table, spread
from robot.lab.task import Result, Task

LEARNERS = ("knn-3", "knn-9", "published-32", "published-64", "published-128", "default-32")


class Figure3(Experiment):
    """How many of 700 frames are classified correctly."""

    name = "figure3"
    title = "Figure 3: footage"
    text = (
        "Each learner sees 700 frames of one drive once, in order, and is tested on 700 of "
        "another drive of the same place. Simulated: two drives of a teacher with different "
        "starts, noise and slips of the hand, in the places of the three trials. Recorded: real "
        "cars driven by people, where a folder of recordings is given."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan every learner on every place and seed, and on every pair of recordings."""
        learners = settings.learners or LEARNERS
        simulated = [
            Task(
                kind="simulated_footage",
                params={**trial, "trial": number, "learner": learner, "seed": seed},
            )
            for number, trial in TRIALS.items()
            for learner in learners
            for seed in range(settings.n_seeds)
        ]
        folder = Path(settings.recordings) if settings.recordings else None
        pairs = recorded_pairs(folder) if folder else []
        recorded = [
            Task(
                kind="recorded_footage",
                params={"train": train, "test": test, "learner": learner},
            )
            for train, test in (pairs[:2] if settings.quick else pairs)
            for learner in learners
            if ":" not in learner
        ]
        return simulated + recorded

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table for simulated, one for recorded footage."""
        tables = []
        for kind, name in (("simulated_footage", "Simulated"), ("recorded_footage", "Recorded")):
            chosen = [(t, r) for t, r in zip(tasks, results, strict=True) if t.kind == kind]
            if chosen:
                grouped = group([t for t, _ in chosen], [r for _, r in chosen], "learner")
                tables.append(
                    Table(
                        title=f"{name} footage: correct of 700",
                        columns=(
                            *("learner", "pairs", "mean", "sd", "accuracy", "balanced"),
                            *("paper mean", "paper sd"),
                        ),
                        rows=tuple(_row(str(key[0]), runs) for key, runs in grouped.items()),
                    )
                )
        return tables

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return mean correct by learner, beside the paper's."""
        grouped = group(tasks, results, "learner")
        learners = tuple(str(key[0]) for key in grouped)
        ours = tuple(spread([run["correct"] for run in runs]).mean for runs in grouped.values())
        known = tuple(name for name in learners if name in FIGURE_3)
        return [
            Plot(
                title="Correct of 700",
                x_label="",
                y_label="frames",
                series=(
                    ("here", learners, ours),
                    ("paper", known, tuple(FIGURE_3[name][0] for name in known)),
                ),
            )
        ]


def _row(learner: str, runs: Sequence[Result]) -> tuple[Cell, ...]:
    correct = spread([700 * run["accuracy"] for run in runs])
    paper: tuple[Cell, ...] = FIGURE_3.get(learner, (None, None))
    return (
        learner,
        correct.n,
        correct.mean,
        correct.sd,
        spread([run["accuracy"] for run in runs]).mean,
        spread([run["balanced_accuracy"] for run in runs]).mean,
        *paper,
    )
