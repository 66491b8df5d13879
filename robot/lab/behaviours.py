"""Beyond the paper: other behaviours (its future work)."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group
from robot.lab.task import Task
from robot.store.table import Table

_MINUTES = {"episode_s": 60.0, "teach": 2, "correct": 2, "alone": 1}
_TAUGHT: Mapping[str, dict[str, Any]] = {
    "follow the wall on the right": {
        "world": "corridor",
        "teacher": "wall",
        "moves": ("forward", "left", "right"),
        **_MINUTES,
    },
    "follow the orange barrel": {
        "world": "follow",
        "teacher": "follow",
        "moves": ("forward", "left", "right", "backward"),
        **_MINUTES,
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


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    for what, behaviour in _TAUGHT.items():
        for learner in settings.learners or LEARNERS:
            for seed in range(settings.n_seeds):
                params = {**behaviour, "what": what, "learner": learner, "seed": seed}
                yield Task("episodes", params)


_COLUMNS = ("runs", "right m", "in view", "at wall", "seconds", "longest push s", "m/min")
_NAMES = ("right_m", "in_view", "brought_to_wall", "seconds", "longest_push_s", "driven_m_per_min")


def _tables(runs: Runs) -> list[Table]:
    """Return one table a behaviour, with all its teachers above the learners."""
    tables = []
    for what in _TAUGHT:
        mine = [run for run in runs if run[0].params["what"] == what]
        rows = {"teacher": [result["teacher"] for _, result in mine]}
        for (learner,), results in group(mine, "learner").items():
            rows[learner] = [result["alone"] for result in results]
        tables.append(
            Table(
                title=what[0].upper() + what[1:],
                columns=("who", *_COLUMNS),
                rows=tuple((name, *_cells(drives)) for name, drives in rows.items()),
            )
        )
    return tables


def _cells(drives: Sequence[Mapping[str, float | None]]) -> tuple[float | int | None, ...]:
    def mean(name: str) -> float | None:
        values = [value for drive in drives if (value := drive[name]) is not None]
        return statistics.fmean(values) if values else None

    return (len(drives), *map(mean, _NAMES))


BEHAVIOURS = Experiment(
    name="behaviours",
    title="Beyond the paper: other behaviours",
    text="Taught in episodes, each from another start: two minutes of teaching and two of "
    "correction (pushing: eight episodes and four), then the robot alone. 'right': median "
    "distance from the robot's middle to what is at its right. 'in view': share of the time "
    "in which the thing is in the picture and within a metre. 'at wall': share of episodes "
    "in which the box was brought to a wall within 40 s.",
    plan=_plan,
    tables=_tables,
)
