"""A changed mind: LEFT at walls for a minute, then RIGHT. How soon does it turn right?"""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from robot.lab.experiment import Experiment, ExperimentSettings, group
from robot.lab.tables import Cell, Table
from robot.lab.task import Result, Task

WORLDS = ("box", "office", "clutter")
LEARNERS = ("default-32", "without-forgetting-32")
FIRST_SEED = 900
NEVER_LEFT = ", never taught left"


class Mind(Experiment):
    """What contrary teaching is worth, beside a robot that was never taught the other side."""

    name = "mind"
    title = "A changed mind"
    text = (
        "A minute of a pilot who turns left alone, then half a minute of one who turns right "
        "alone, and again half a minute; after each the robot is asked, without learning, what it "
        "would do where that pilot turns right. 'right': share of those views with less than "
        "22 cm of free way on which it would turn right. 'of all': of all views on which the "
        "pilot turns; towards the end of a turn the same view means both. 'own turns': of its "
        "turns in a minute alone, afterwards, those to the right. The rows 'never taught left' "
        "are what can be had at all."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan every learner in every place, at 10 and 30 frames a second in turn."""
        learners = settings.learners or LEARNERS
        return [
            Task(
                kind="mind",
                params={
                    "world": world,
                    "learner": learner,
                    "seed": FIRST_SEED + seed,
                    "rate_hz": (10.0, 30.0)[seed % 2],
                    "old_s": old_s,
                    "new_s": 30.0,
                    "asked_s": 40.0,
                    "alone_s": 60.0,
                },
            )
            for learner, old_s in (*((name, 60.0) for name in learners), (learners[0], 0.0))
            for world in (WORLDS[:1] if settings.quick else WORLDS)
            for seed in range(1 if settings.quick else max(2, settings.n_seeds))
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table."""
        rows: list[tuple[Cell, ...]] = []
        for (learner, old_s), runs in group(tasks, results, "learner", "old_s").items():
            name = f"{learner}{'' if old_s else NEVER_LEFT}"
            for phase, seconds in (("first", 30), ("second", 60)):
                asked = [run[phase] for run in runs if run[phase]["blocked"]]
                shares = [each["right"] / each["blocked"] for each in asked]
                rows.append(
                    (
                        f"{name}, after {seconds} s",
                        len(shares),
                        f"{100 * statistics.median(shares):.0f} %",
                        f"{100 * statistics.fmean(shares):.0f} %",
                        f"{100 * min(shares):.0f} %",
                        _percent([run[phase] for run in runs], "left", "blocked"),
                        _percent([run[phase] for run in runs], "turning_right", "turning"),
                        _percent([run["alone"] for run in runs], "right", "turns")
                        if phase == "second"
                        else None,
                    )
                )
        columns = ("", "runs", "right, median", "mean", "least", "left", "of all", "own turns")
        return [Table(title="Where the pilot turns right", columns=columns, rows=tuple(rows))]


def _percent(counts: Sequence[dict[str, int]], part: str, whole: str) -> str:
    total = sum(count[whole] for count in counts)
    return f"{100 * sum(count[part] for count in counts) / max(total, 1):.0f} %"
