"""What each part of the default learner contributes to driving: trials 2 and 3 without it."""

from __future__ import annotations

from collections.abc import Sequence

from robot.lab.experiment import ExperimentSettings, Plot, group
from robot.lab.figure7 import plan_trial
from robot.lab.tables import SSD_COLUMNS, Table, ssd_cells
from robot.lab.task import Result, Task
from robot.lab.variants import VARIANTS

KINDS = ("default", *(kind for kind in VARIANTS if kind != "whole-numbers"), "published")
NODES = {2: 32, 3: 128}


class Ablation:
    """The default, and the default without one of its parts, in closed loop."""

    name = "ablation"
    title = "Ablation in closed loop"
    text = (
        "As figure 7 after retraining: trial 2 with 32 nodes, trial 3 with 128. Each row has one "
        "part of the default learner changed (robot/policy/variants.py)."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan every kind with every seed."""
        return [
            task
            for trial, nodes in NODES.items()
            for task in plan_trial(trial, [f"{kind}-{nodes}" for kind in KINDS], settings)
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table a trial."""
        grouped = group(tasks, results, "trial", "learner")
        return [
            Table(
                title=f"Trial {trial} after retraining",
                columns=("SSD", *SSD_COLUMNS),
                rows=tuple(
                    (str(learner), *ssd_cells([run["after"] for run in runs]))
                    for (number, learner), runs in grouped.items()
                    if number == trial
                ),
            )
            for trial in NODES
        ]

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return no plots: the table is enough."""
        return []
