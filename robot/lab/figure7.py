"""Figure 7: does retraining help? Three trials with simulated human teachers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robot.lab.experiment import ExperimentSettings, Plot, group
from robot.lab.published import FIGURE_7
from robot.lab.tables import SSD_COLUMNS, Cell, Table, spread, ssd_cells
from robot.lab.task import Result, Task

TRIALS: dict[int, dict[str, Any]] = {
    1: {"world": "box", "moves": ("forward", "left"), "teacher": "usual"},
    2: {"world": "office", "moves": ("forward", "left"), "teacher": "usual"},
    3: {"world": "office", "moves": ("forward", "left", "right"), "teacher": "habit"},
}
"""The paper's places and moves; the teachers are ours."""
PHASES = {"teach_s": 90.0, "correct_s": 330.0, "alone_s": 60.0}


def plan_trial(trial: int, learners: Sequence[str], settings: ExperimentSettings) -> list[Task]:
    """Plan one of the paper's trials with every learner and seed."""
    setting = TRIALS[trial]
    return [
        Task(
            kind="lesson",
            params={
                **setting,
                **PHASES,
                "teacher": settings.teacher or setting["teacher"],
                "trial": trial,
                "learner": learner,
                "seed": seed,
            },
        )
        for learner in learners
        for seed in range(settings.n_seeds)
    ]


class Figure7:
    """SSD before and after five and a half minutes of corrections."""

    name = "figure7"
    title = "Figure 7: retraining"
    text = (
        "90 s of teaching, 60 s alone (before), 330 s in which the pilot corrects, 60 s alone "
        "(after). Trial 1: box, FORWARD and LEFT. Trial 2: office, the same moves. Trial 3: "
        "office, RIGHT as well. The robot is held against the profile of all that its teacher "
        "drove (teaching and 4 minutes more, of which the robot learns nothing that is measured); "
        "'against lesson' holds it against the 90 s of teaching alone. The row 'teacher' is the "
        "teacher's own last minute: less than that is chance."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan every trial with every learner and seed."""
        return [
            task
            for trial in TRIALS
            for task in plan_trial(trial, settings.learners or self._learners(trial), settings)
        ]

    def _learners(self, trial: int) -> tuple[str, ...]:
        more = ("published-128", "default-128") if trial == 3 else ()
        return ("published-32", "default-32", *more)

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table a trial."""
        grouped = group(tasks, results, "trial", "learner")
        return [
            Table(
                title=f"Trial {number}: {TRIALS[number]['world']}, "
                f"{', '.join(TRIALS[number]['moves'])}",
                columns=("SSD", *SSD_COLUMNS),
                rows=tuple(_rows(number, grouped)),
            )
            for number in TRIALS
        ]

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return the medians after retraining, by trial."""
        grouped = group(tasks, results, "trial", "learner")
        learners = list(dict.fromkeys(str(key[1]) for key in grouped))
        series = []
        for learner in learners:
            trials = [key[0] for key in grouped if key[1] == learner]
            medians = [
                spread([run["after"]["ssd"] for run in grouped[trial, learner]]).median
                for trial in trials
            ]
            series.append((learner, tuple(f"trial {trial}" for trial in trials), tuple(medians)))
        paper = tuple(FIGURE_7[trial]["after"][0] for trial in FIGURE_7)
        series.append(("paper (mean)", tuple(f"trial {trial}" for trial in FIGURE_7), paper))
        return [
            Plot(
                title="After retraining",
                x_label="",
                y_label="median SSD",
                series=tuple(series),
                log_y=True,
            )
        ]


def _rows(trial: int, grouped: dict[tuple[object, ...], list[Result]]) -> list[tuple[Cell, ...]]:
    rows: list[tuple[Cell, ...]] = []
    for phase, (mean, sd, largest) in FIGURE_7[trial].items():
        nothing: tuple[Cell, ...] = (None,) * (len(SSD_COLUMNS) - 5)
        rows.append((f"paper, {phase}", None, mean, sd, None, largest, *nothing))
    for (number, learner), runs in grouped.items():
        if number != trial:
            continue
        for phase in ("before", "after"):
            rows.append((f"{learner}, {phase}", *ssd_cells([run[phase] for run in runs])))
    everyone = [
        run["teacher"] for (number, _), runs in grouped.items() if number == trial for run in runs
    ]
    rows.append(("teacher", *ssd_cells(everyone)))
    return rows
