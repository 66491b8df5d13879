"""Figure 6: SSD against nodes, self-trained by the paper's sonar controller."""

from __future__ import annotations

from collections.abc import Sequence

from robot.lab.experiment import ExperimentSettings, Plot, group
from robot.lab.published import FIGURE_6
from robot.lab.tables import SSD_COLUMNS, Cell, Table, spread, ssd_cells
from robot.lab.task import Result, Task

NODES = tuple(FIGURE_6)
KINDS = ("published", "default")


class Figure6:
    """Does the robot drive more like its teacher as nodes are added?"""

    name = "figure6"
    title = "Figure 6: nodes"
    text = (
        "In the box, the sonar controller (below 20 cm or bumped: left for two seconds, else "
        "forward) drives for 90 s, then the robot drives 60 s alone; nobody corrects it."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan each number of nodes with every seed; a learner that is named has its own number."""
        learners = [(f"{kind}-{nodes}", kind, nodes) for kind in KINDS for nodes in NODES]
        if settings.learners:
            learners = [(name, name, 0) for name in settings.learners]
        return [
            Task(
                kind="lesson",
                params={
                    "world": "box",
                    "moves": ("forward", "left"),
                    "teacher": settings.teacher or "sonar",
                    "learner": learner,
                    "kind": kind,
                    "nodes": nodes,
                    "teach_s": 90.0,
                    "seed": seed,
                },
            )
            for learner, kind, nodes in learners
            for seed in range(settings.n_seeds)
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table."""
        nothing: tuple[Cell, ...] = (None,) * (len(SSD_COLUMNS) - 3)
        rows: list[tuple[Cell, ...]] = [
            (f"paper, {nodes} nodes", None, mean, sd, *nothing)
            for nodes, (mean, sd) in FIGURE_6.items()
        ]
        for (kind, nodes), runs in group(tasks, results, "kind", "nodes").items():
            name = f"{kind}, {nodes} nodes" if nodes else str(kind)
            rows.append((name, *ssd_cells([run["before"] for run in runs])))
        return [Table(title="SSD by nodes", columns=("SSD", *SSD_COLUMNS), rows=tuple(rows))]

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return mean SSD against nodes, of the kinds that were run with each number of them."""
        series = []
        for (kind,), _ in group(tasks, results, "kind").items():
            if kind not in KINDS:
                continue
            grouped = group(tasks, results, "kind", "nodes")
            means = tuple(
                spread([run["before"]["ssd"] for run in grouped[kind, nodes]]).mean
                for nodes in NODES
            )
            series.append((str(kind), NODES, means))
        series.append(("paper", NODES, tuple(mean for mean, _ in FIGURE_6.values())))
        return [
            Plot(
                title="SSD, self-trained",
                x_label="nodes",
                y_label="mean SSD",
                series=tuple(series),
                log_y=True,
            )
        ]
