"""Beyond the paper: other behaviours (its future work)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robot.lab.experiment import Experiment, ExperimentSettings, group
from robot.lab.tables import Table, spread
from robot.lab.task import Result, Task

BEHAVIOURS: Mapping[str, dict[str, Any]] = {
    "follow the wall on the right": {
        "world": "corridor",
        "teacher": "wall",
        "moves": ("forward", "left", "right"),
        "episode_s": 60.0,
        "teach": 2,
        "correct": 2,
        "alone": 1,
    },
    "follow the orange barrel": {
        "world": "follow",
        "teacher": "follow",
        "moves": ("forward", "left", "right", "backward"),
        "episode_s": 60.0,
        "teach": 2,
        "correct": 2,
        "alone": 1,
    },
    "push the blue box to a wall": {
        "world": "push",
        "teacher": "push",
        "moves": ("forward", "left", "right"),
        "episode_s": 40.0,
        "teach": 8,
        "correct": 4,
        "alone": 5,
    },
}
LEARNERS = ("published-32", "default-32", "default-128")


class Behaviours(Experiment):
    """Wall following, following a thing, pushing a thing."""

    name = "behaviours"
    title = "Beyond the paper: other behaviours"
    text = (
        "Taught in episodes, each from another start: two minutes of teaching and two of "
        "correction (pushing: eight episodes and four), then the robot alone. 'right': median "
        "distance from the robot's middle to what is at its right. 'in view': share of the time "
        "in which the thing is in the picture and within a metre. 'at wall': share of episodes "
        "in which the box was brought to a wall within 40 s."
    )

    def plan(self, settings: ExperimentSettings) -> list[Task]:
        """Plan each behaviour with each learner and seed."""
        return [
            Task(
                kind="episodes",
                params={**behaviour, "what": what, "learner": learner, "seed": seed},
            )
            for what, behaviour in BEHAVIOURS.items()
            for learner in settings.learners or LEARNERS
            for seed in range(settings.n_seeds)
        ]

    def tables(
        self, settings: ExperimentSettings, tasks: Sequence[Task], results: Sequence[Result]
    ) -> list[Table]:
        """Return one table a behaviour."""
        grouped = group(tasks, results, "what", "learner")
        tables = []
        for what in BEHAVIOURS:
            runs = {str(key[1]): value for key, value in grouped.items() if key[0] == what}
            everyone = [run["teacher"] for value in runs.values() for run in value]
            rows = [(name, *_cells([r["alone"] for r in value])) for name, value in runs.items()]
            tables.append(
                Table(
                    title=what[0].upper() + what[1:],
                    columns=("who", *_COLUMNS),
                    rows=(("teacher", *_cells(everyone)), *rows),
                )
            )
        return tables


_COLUMNS = ("runs", "right m", "in view", "at wall", "seconds", "longest push s", "m/min")
_NAMES = ("right_m", "in_view", "brought_to_wall", "seconds", "longest_push_s", "driven_m_per_min")


def _cells(figures: Sequence[Mapping[str, float | None]]) -> tuple[float | int | None, ...]:
    def mean(name: str) -> float | None:
        values = [value for each in figures if (value := each[name]) is not None]
        return spread(values).mean if values else None

    return (len(figures), *(mean(name) for name in _NAMES))
