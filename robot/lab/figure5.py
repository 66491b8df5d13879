"""Figure 5: cycles a second against nodes, camera and drive included, on this machine."""

from __future__ import annotations

import platform
from collections.abc import Sequence

from robot.lab.experiment import Experiment, ExperimentSettings, Plot, group
from robot.lab.published import FIGURE_5_APPLYING_HZ, FIGURE_5_LEARNING_HZ
from robot.lab.tables import Table
from robot.lab.task import Result, Task

NODES = (2, 4, 8, 16, 32, 64, 128)
KINDS = ("published", "default")


class Figure5(Experiment):
    """How the cycle slows down as nodes are added."""

    name = "figure5"
    title = "Figure 5: speed"
    text = (
        "One cycle: picture, features, decision, drive, and while learning an example. Every "
        "node is used before the clock starts. In the simulator a cycle also renders the picture "
        "and moves the world; a real robot (--robot) waits for its camera, as in the paper. Runs "
        "one at a time, whatever --jobs says."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan each number of nodes, for the published learner and the default."""
        kinds = settings.learners or KINDS
        return [
            Task(
                kind="cycles",
                params={
                    "learner": f"{kind}-{nodes}" if kind in KINDS else kind,
                    "nodes": nodes,
                    "kind": kind,
                    "robot": settings.robot,
                    "cycles": 100 if settings.quick else 600,
                    "machine": platform.node(),
                },
            )
            for kind in kinds
            for nodes in NODES
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table."""
        rows = []
        for (kind, nodes), (run,) in group(tasks, results, "kind", "nodes").items():
            timing = run["timing"]
            n = int(str(nodes))
            rows.append(
                (
                    str(kind),
                    n,
                    timing["learning_hz"],
                    timing["applying_hz"],
                    FIGURE_5_LEARNING_HZ.get(n),
                    FIGURE_5_APPLYING_HZ.get(n),
                )
            )
        return [
            Table(
                title=f"Cycles a second, robot {settings.robot}",
                columns=(
                    *("learner", "nodes", "learning", "applying"),
                    *("paper (EV3) learning", "paper (EV3) applying"),
                ),
                rows=tuple(rows),
            )
        ]

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return cycles a second against nodes."""
        series = []
        for (kind,), runs in group(tasks, results, "kind").items():
            nodes = tuple(int(t.params["nodes"]) for t in tasks if t.params["kind"] == kind)
            for phase in ("learning", "applying"):
                rates = tuple(run["timing"][f"{phase}_hz"] for run in runs)
                series.append((f"{kind}, {phase}", nodes, rates))
        paper = FIGURE_5_LEARNING_HZ
        series.append(("paper (EV3), learning", tuple(paper), tuple(paper.values())))
        return [
            Plot(
                title="Cycles a second",
                x_label="nodes",
                y_label="Hz",
                series=tuple(series),
                log_y=True,
            )
        ]
