"""Figure 8: SSD by training time, taught by the sonar controller and by simulated people."""

from __future__ import annotations

from collections.abc import Sequence

from robot.lab.experiment import ExperimentSettings, Plot, group
from robot.lab.figure7 import TRIALS
from robot.lab.published import FIGURE_8
from robot.lab.tables import SSD_COLUMNS, Cell, Table, spread, ssd_cells
from robot.lab.task import Result, Task

SECONDS = (90, 180)
LEARNERS = ("published-32", "default-32")


class Figure8:
    """Does more teaching help?"""

    name = "figure8"
    title = "Figure 8: training time"
    text = (
        "60 s alone straight after 90 s or 180 s of teaching. 'robot': the sonar controller in "
        "the box. 'human': simulated people in the three trials of figure 7, before any "
        "correction."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan both teachers, both times, every seed."""
        sonar = {"world": "box", "moves": ("forward", "left"), "teacher": "sonar"}
        places = [("robot", sonar), *(("human", trial) for trial in TRIALS.values())]
        return [
            Task(
                kind="lesson",
                params={
                    **place,
                    "who": who,
                    "learner": learner,
                    "teach_s": float(seconds),
                    "seed": seed,
                },
            )
            for learner in settings.learners or LEARNERS
            for who, place in places
            for seconds in SECONDS
            for seed in range(settings.n_seeds)
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table."""
        nothing: tuple[Cell, ...] = (None,) * (len(SSD_COLUMNS) - 2)
        rows: list[tuple[Cell, ...]] = [
            (f"paper, {who}, {seconds} s", None, mean, *nothing)
            for (who, seconds), mean in FIGURE_8.items()
        ]
        for (learner, who, seconds), runs in self._grouped(tasks, results).items():
            label = f"{learner}, {who}, {float(str(seconds)):.0f} s"
            rows.append((label, *ssd_cells([run["before"] for run in runs])))
        return [
            Table(title="SSD by training time", columns=("SSD", *SSD_COLUMNS), rows=tuple(rows))
        ]

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return mean SSD by teacher and time."""
        names = tuple(f"{who} {seconds} s" for who, seconds in FIGURE_8)
        grouped = self._grouped(tasks, results)
        series = []
        for learner in dict.fromkeys(str(key[0]) for key in grouped):
            means = tuple(
                spread([run["before"]["ssd"] for run in grouped[learner, who, float(seconds)]]).mean
                for who, seconds in FIGURE_8
            )
            series.append((learner, names, means))
        series.append(("paper", names, tuple(FIGURE_8.values())))
        return [Plot(title="Training time", x_label="", y_label="mean SSD", series=tuple(series))]

    def _grouped(
        self, tasks: Sequence[Task], results: Sequence[Result]
    ) -> dict[tuple[object, ...], list[Result]]:
        return group(tasks, results, "learner", "who", "teach_s")
