"""Figure 5: cycles a second against nodes, camera and drive included, on this machine."""

from __future__ import annotations

import platform
from collections.abc import Iterator

from robot.lab.experiment import Experiment, ExperimentSettings, Plot, Runs, Series, group
from robot.lab.published import FIGURE_5_APPLYING_HZ, FIGURE_5_LEARNING_HZ
from robot.lab.task import Task
from robot.store.table import Cell, Table

NODES = (2, 4, 8, 16, 32, 64, 128)
KINDS = ("published", "default")


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan each number of nodes, for the published learner and the default."""
    for kind in settings.learners or KINDS:
        for nodes in NODES:
            params = {
                "learner": f"{kind}-{nodes}" if kind in KINDS else kind,
                "nodes": nodes,
                "kind": kind,
                "robot": settings.robot,
                "cycles": 100 if settings.quick else 600,
                "machine": platform.node(),
            }
            yield Task("cycles", params)


def _tables(runs: Runs) -> list[Table]:
    rows: list[tuple[Cell, ...]] = []
    for task, result in runs:
        kind, nodes, timing = task.params["kind"], task.params["nodes"], result["timing"]
        paper = (FIGURE_5_LEARNING_HZ.get(nodes), FIGURE_5_APPLYING_HZ.get(nodes))
        rows.append((kind, nodes, timing["learning_hz"], timing["applying_hz"], *paper))
    columns = (
        *("learner", "nodes", "learning", "applying"),
        *("paper (EV3) learning", "paper (EV3) applying"),
    )
    robot = runs[0][0].params["robot"]
    return [Table(title=f"Cycles a second, robot {robot}", columns=columns, rows=tuple(rows))]


def _plots(runs: Runs) -> list[Plot]:
    series: list[Series] = []
    for (kind,), results in group(runs, "kind").items():
        for phase in ("learning", "applying"):
            rates = tuple(result["timing"][f"{phase}_hz"] for result in results)
            series.append((f"{kind}, {phase}", NODES, rates))
    paper = FIGURE_5_LEARNING_HZ
    series.append(("paper (EV3), learning", tuple(paper), tuple(paper.values())))
    return [Plot(title="Cycles a second", x_label="nodes", y_label="Hz", series=series, log_y=True)]


FIGURE5 = Experiment(
    name="figure5",
    title="Figure 5: speed",
    text="One cycle: picture, features, decision, drive, and while learning an example. Every "
    "node is used before the clock starts. In the simulator a cycle also renders the picture "
    "and moves the world; a real robot (--robot) waits for its camera, as in the paper. Runs "
    "one at a time, whatever --jobs says.",
    plan=_plan,
    tables=_tables,
    plots=_plots,
)
