"""Repeats the paper's figure 3: each learner is trained on 700 frames of one drive and tested on
700 frames of another, without a robot."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from itertools import product
from pathlib import Path

from robot.control.state import Tick
from robot.lab.chance import deviation
from robot.lab.evaluation import judge, recorded_pairs, seen_by
from robot.lab.experiment import Experiment, ExperimentSettings, Runs, seeded
from robot.lab.ideas import make_learner, make_trial
from robot.lab.lessons import TRIALS
from robot.lab.tables import Columns, of, tables_of
from robot.lab.task import Params, Result, Task
from robot.study.table import Table
from robot.types import DEFAULT_MOVES, Action, Frame, Mode

LEARNERS = ("knn-3", "knn-9", "published-32", "published-64", "published-128", "default-32")
PAPERS_BASELINES = ("som-32", "gng-32", "alvinn-8")
"""The paper's other learners, used if their libraries are installed (extra `rivals`)."""
KINDS = {"simulated_footage": "Simulated", "recorded_footage": "Recorded"}
FRAMES = 700
"""Number of frames for the training, and for the test, as in the paper."""
PUBLISHED = {
    "knn-3": (609.5, 46.1),
    "knn-9": (624.4, 36.1),
    "published-32": (601.1, 52.0),
    "published-64": (614.5, 40.5),
    "published-128": (616.1, 36.6),
}
"""The paper's results: mean and standard deviation of the number of correct frames out of 700."""


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan one task for each combination of learner, place and seed. Also plan one task for each
    learner and pair of recordings, if there are recordings."""
    learners = settings.learners or (*LEARNERS, *(PAPERS_BASELINES if find_spec("minigng") else ()))
    cases = (
        {**settings.taught(trial), "trial": number, "learner": learner}
        for (number, trial), learner in product(TRIALS.items(), learners)
    )
    yield from seeded(run_simulated_footage, cases, settings)
    yield from recorded_tasks(settings, learners)


def recorded_tasks(settings: ExperimentSettings, learners: Iterable[str]) -> Iterator[Task]:
    """Yield a task for every learner on every pair of recordings. Without a folder of recordings,
    there are no tasks."""
    pairs = recorded_pairs(Path(settings.recordings)) if settings.recordings else []
    for (train, test), learner in product(pairs[:2] if settings.quick else pairs, learners):
        params = {"train": str(train), "test": str(test), "learner": learner}
        yield Task(run_recorded_footage, params)


def _tables(runs: Runs) -> list[Table]:
    results = (
        (
            f"{KINDS[task.kind]} footage: correct of 700",
            task.params["learner"],
            {
                **result,
                "correct": 700 * result["accuracy"],
                "paper": PUBLISHED.get(task.params["learner"], (None, None)),
            },
        )
        for task, result in runs
    )
    return tables_of(results, _COLUMNS, "learner")


_COLUMNS: Columns = {
    "pairs": len,
    "mean": of("correct", statistics.fmean),
    "sd": of("correct", deviation),
    "accuracy": of("accuracy", statistics.fmean),
    "balanced": of("balanced_accuracy", statistics.fmean),
    "paper mean": of("paper", lambda papers: papers[0][0]),
    "paper sd": of("paper", lambda papers: papers[0][1]),
}


KEPT = ("accuracy", "balanced_accuracy", "calibration_error")


def run_simulated_footage(params: Params) -> Result:
    """Train on a teacher's drive, test on another. Parameters: `world`, `teacher`, `moves`,
    `learner`, `seed`.

    Both drives are in the same place, but their starts, noise and slips of the hand differ.
    """
    policy = make_learner(params["learner"], tuple(map(Action, params["moves"])))
    train, test = (
        [(policy.extract(frame), label, None) for frame, label in _film(params, drive)]
        for drive in (0, 1)
    )
    result = judge(policy, train, test)
    return {name: result[name] for name in KEPT}


def run_recorded_footage(params: Params) -> Result:
    """Train on one recording, test on another. Parameters: `train` and `test` (paths),
    `learner`."""
    # imported here, because it is part of another extension
    from robot.exchange.npz import load_recording

    policy = make_learner(params["learner"], DEFAULT_MOVES)
    train, test = (seen_by(policy, load_recording(params[part]), {}) for part in ("train", "test"))
    result = judge(policy, train, test)
    return {name: result[name] for name in KEPT}


def _film(params: Params, drive: int) -> list[tuple[Frame, Action]]:
    footage: list[tuple[Frame, Action]] = []

    def note(tick: Tick) -> None:
        held = tick.commands[-1].held if tick.commands else None
        if tick.frame is not None and held is not None:
            footage.append((tick.frame, held))

    seed = 2 * params["seed"] + drive
    with make_trial({**params, "learner": "published-1", "seed": seed}) as trial:
        trial.loop.subscribe(note)
        while len(footage) < FRAMES:
            trial.drive(Mode.TRAIN, 5.0)
    return footage[:FRAMES]


FIGURE3 = Experiment(
    title="Figure 3: footage",
    text="Each learner sees 700 frames of one drive once, in order, and is tested on 700 frames of "
    "another drive of the same place. Simulated: two drives of a teacher with different "
    "starts, noise and slips of the hand, in the places of the three trials. Recorded: real "
    "cars driven by people, if a folder of recordings is given.",
    plan=_plan,
    tables=_tables,
    drawn=("mean", "paper mean"),
)
