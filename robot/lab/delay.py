"""Beyond the paper: which frame should a command label when the link is slow?"""

from __future__ import annotations

from collections.abc import Sequence

from robot.lab.experiment import ExperimentSettings, Plot, group
from robot.lab.figure7 import TRIALS
from robot.lab.tables import SSD_COLUMNS, Table, spread, ssd_cells
from robot.lab.task import Result, Task

LEARNERS = ("default-32",)
_NAMED = {True: "the frame on the screen", False: "the newest frame"}


class Delay:
    """Labels on the frame that the pilot saw, and on the newest one."""

    name = "delay"
    title = "Delay: does naming the frame help?"
    text = (
        "Box and office with two moves: 90 s of teaching over a link with a delay (half for the "
        "picture, half for the command), 60 s alone. The label goes to the frame that the "
        "command names, which is the one on the screen, or to the newest frame when the command "
        "comes. The pilot's own reaction time of 0.2 s is there in every run. The governor, "
        "which forbids learning over slow links, is switched off for this question."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan each delay with both ways of labelling."""
        return [
            Task(
                kind="lesson",
                params={
                    **TRIALS[trial],
                    "trial": trial,
                    "learner": learner,
                    "teach_s": 90.0,
                    "delay_ms": delay_ms,
                    "names_frame": names_frame,
                    "seed": seed,
                },
            )
            for learner in settings.learners or LEARNERS
            for trial in (1, 2)
            for delay_ms in settings.delays_ms
            for names_frame in (True, False)
            for seed in range(settings.n_seeds)
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table a place."""
        grouped = group(tasks, results, "trial", "learner", "delay_ms", "names_frame")
        tables = []
        for trial in (1, 2):
            rows = tuple(
                (
                    f"{learner}, {delay_ms} ms, {_NAMED[bool(named)]}",
                    spread([run["taught"]["agreement"] for run in runs]).mean,
                    *ssd_cells([run["before"] for run in runs]),
                )
                for (number, learner, delay_ms, named), runs in grouped.items()
                if number == trial
            )
            tables.append(
                Table(
                    title=f"Delay: {TRIALS[trial]['world']}",
                    columns=("SSD", "agreement", *SSD_COLUMNS),
                    rows=rows,
                )
            )
        return tables

    def plots(self, tasks: Sequence[Task], results: Sequence[Result]) -> list[Plot]:
        """Return median SSD against delay, both ways."""
        grouped = group(tasks, results, "names_frame", "delay_ms")
        delays = tuple(dict.fromkeys(int(str(key[1])) for key in grouped))
        return [
            Plot(
                title="Link delay",
                x_label="ms",
                y_label="median SSD",
                series=tuple(
                    (
                        f"label on {_NAMED[named]}",
                        delays,
                        tuple(
                            spread([run["before"]["ssd"] for run in grouped[named, ms]]).median
                            for ms in delays
                        ),
                    )
                    for named in (True, False)
                ),
            )
        ]
