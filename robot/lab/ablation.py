"""Measures how much each mechanism of policy and learner helps, by changing it in every world."""

from __future__ import annotations

import statistics
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import product

from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group, seeded
from robot.lab.figure3 import KEPT, recorded_tasks
from robot.lab.ground.ground import FIRST_SEED, score_at
from robot.lab.ground.run import run_ground
from robot.lab.lessons import run_lesson, trial_cases
from robot.lab.task import Task
from robot.lab.variants import VARIANTS
from robot.policy.registry import split_name
from robot.study.table import Cell, Table

KINDS = ("default", *VARIANTS, "published")
NODES = {2: 32, 3: 128}
"""Number of nodes of the learners in each trial of this project's simulator. In third-party
worlds and on footage, learners have 32 nodes."""
WORLDS = {"Sidewalk": "miniworld", "CarRacing": "Box2D", "ViZDoom": "vizdoom"}
"""The third-party worlds of this experiment, each with the library that it needs."""
EXAMPLES = 250
"""Number of examples that a robot is taught by corrections in each of `WORLDS`, before it drives
unaided."""


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan runs of all kinds of learners: in the simulator, on all footage, and in each third-party
    world whose library is installed."""
    for trial, nodes in list(NODES.items())[: 1 if settings.quick else None]:
        learners = [f"{kind}-{nodes}" for kind in KINDS]
        yield from seeded(run_lesson, trial_cases(trial, learners, settings), settings)
    learners = [f"{kind}-32" for kind in KINDS]
    here = tuple(world for world, package in WORLDS.items() if find_spec(package))
    counts, drives = ([100], 2) if settings.quick else ([EXAMPLES], 10)
    way = {"way": "corrections", "counts": counts, "drives": drives}
    cases = (
        {"world": world, "learner": learner, **way}
        for world, learner in product(settings.worlds or here, learners)
    )
    yield from seeded(run_ground, cases, settings, first=FIRST_SEED)
    yield from recorded_tasks(settings, learners)


def _tables(runs: Runs) -> list[Table]:
    lessons, ground, footage = (
        [run for run in runs if run[0].kind == kind]
        for kind in ("lesson", "ground", "recorded_footage")
    )
    columns: dict[str, dict[str, Cell]] = {}
    for (trial, learner), results in group(lessons, "trial", "learner").items():
        ssds = [result["after"]["ssd"] for result in results]
        pushes_s = [result["after"]["longest_push_s"] for result in results]
        for what, cell in (("SSD", statistics.median(ssds)), ("longest push s", max(pushes_s))):
            columns.setdefault(f"trial {trial}: {what}", {})[split_name(learner)[0]] = cell
    for (world, learner), results in group(ground, "world", "learner").items():
        columns.setdefault(world, {})[split_name(learner)[0]] = score_at(0)(results)
    for (learner,), results in group(footage, "learner").items():
        for name in KEPT:
            mean = statistics.fmean(result[name] for result in results)
            column = columns.setdefault(f"footage: {name.replace('_', ' ')}", {})
            column[split_name(learner)[0]] = f"{mean:.3f}"
    kinds = dict.fromkeys(kind for column in columns.values() for kind in column)
    rows = tuple((kind, *(column.get(kind) for column in columns.values())) for kind in kinds)
    missing = [world for world in WORLDS if world not in columns]
    missing += [] if footage else ["footage (--recordings FOLDER)"]
    note = f"Not run: {', '.join(missing)}." if missing else ""
    title = "With one thing changed"
    return [Table(title=title, columns=("", *columns), rows=rows, note=note)]


ABLATION = Experiment(
    title="Ablation: what each mechanism is worth",
    text="Each row changes one mechanism of the default (robot/lab/variants.py). Our simulator: "
    "trial 2 with 32 nodes and trial 3 with 128, after retraining as in figure 7. Worlds that "
    "others made (the extra ground): the unaided score after 250 examples by corrections, and "
    "the 95 % interval of the mean over seeds. Footage: trained on one drive of a place, "
    "tested on another.",
    plan=_plan,
    tables=_tables,
)
