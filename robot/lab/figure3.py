"""Figure 3: trained on 700 frames of one drive, tested on 700 of another; without a robot."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from pathlib import Path

from robot.control.state import Tick
from robot.lab.evaluation import Pair, evaluate, recorded_pairs, scores
from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group, seeded
from robot.lab.ideas import make_learner, make_pilot
from robot.lab.lessons import TRIALS
from robot.lab.published import FIGURE_3
from robot.lab.tables import deviation
from robot.lab.task import Params, Result, Task
from robot.lab.trial import Trial
from robot.policy.registry import make_policy
from robot.store.table import Cell, Table
from robot.types import Action, Frame, Mode

LEARNERS = ("knn-3", "knn-9", "published-32", "published-64", "published-128", "default-32")
KINDS = {"simulated_footage": "Simulated", "recorded_footage": "Recorded"}
FRAMES = 700
"""Frames to train on, and as many to test on, as in the paper."""

_Footage = list[tuple[Frame, Action]]


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan every learner on every place and seed, and on every pair of recordings."""
    learners = settings.learners or LEARNERS
    cases = (
        {**trial, "trial": number, "learner": learner}
        for (number, trial), learner in product(TRIALS.items(), learners)
    )
    yield from seeded(run_simulated_footage, cases, settings)
    yield from recorded_tasks(settings, [name for name in learners if ":" not in name])


def recorded_tasks(settings: ExperimentSettings, learners: Iterable[str]) -> Iterator[Task]:
    """Yield every learner on every pair of recordings, if a folder of them was given."""
    pairs = recorded_pairs(Path(settings.recordings)) if settings.recordings else []
    for (train, test), learner in product(pairs[:2] if settings.quick else pairs, learners):
        params = {"train": str(train), "test": str(test), "learner": learner}
        yield Task(run_recorded_footage, params)


def _tables(runs: Runs) -> list[Table]:
    by_kind = {kind: [run for run in runs if run[0].kind == kind] for kind in KINDS}
    return [
        Table(
            title=f"{KINDS[kind]} footage: correct of 700",
            columns=(
                *("learner", "pairs", "mean", "sd", "accuracy", "balanced"),
                *("paper mean", "paper sd"),
            ),
            rows=tuple(_row(key[0], results) for key, results in group(mine, "learner").items()),
        )
        for kind, mine in by_kind.items()
        if mine
    ]


def _row(learner: str, results: Sequence[Result]) -> tuple[Cell, ...]:
    correct = [700 * result["accuracy"] for result in results]
    paper: tuple[Cell, ...] = FIGURE_3.get(learner, (None, None))
    shares = (
        statistics.fmean(result[name] for result in results)
        for name in ("accuracy", "balanced_accuracy")
    )
    return (learner, len(correct), statistics.fmean(correct), deviation(correct), *shares, *paper)


def run_simulated_footage(params: Params) -> Result:
    """Train on a teacher's drive, test on another; `world`, `teacher`, `moves`, `learner`, `seed`.

    Both drives are of the same place, with other starts, noise and slips of the hand.
    """
    moves = tuple(Action(move) for move in params["moves"])
    train, test = (_film({**params, "seed": 2 * params["seed"] + drive}, moves) for drive in (0, 1))
    policy = make_learner(params["learner"], moves)
    for frame, label in train:
        policy.learn(policy.extract(frame), label)
    policy.reset()
    proposed = [
        policy.propose(i + 1, policy.extract(frame)).action for i, (frame, _) in enumerate(test)
    ]
    accuracy, balanced = scores([label for _, label in test], proposed)
    return {
        "correct": round(accuracy * len(test)),
        "frames": len(test),
        "accuracy": accuracy,
        "balanced_accuracy": balanced,
    }


def run_recorded_footage(params: Params) -> Result:
    """Train on one recording, test on another; `train`, `test` (paths) and `learner`."""
    from robot.exchange.npz import load_recording  # of another house, asked for when needed

    pair = Pair(train=load_recording(params["train"]), test=load_recording(params["test"]))
    result = next(iter(evaluate([pair], [params["learner"]])))
    names = ("correct", "frames", "accuracy", "balanced_accuracy", "calibration_error")
    return {name: getattr(result, name) for name in names}


def _film(params: Params, moves: tuple[Action, ...]) -> _Footage:
    footage: _Footage = []

    def note(tick: Tick) -> None:
        held = tick.commands[-1].held if tick.commands else None
        if tick.frame is not None and held is not None:
            footage.append((tick.frame, held))

    policy, pilot = make_policy("published-1", moves=moves), make_pilot(params, moves)
    with Trial(params["world"], params["seed"], policy, pilot) as trial:
        trial.loop.subscribe(note)
        while len(footage) < FRAMES:
            trial.drive(Mode.TRAIN, 5.0)
    return footage[:FRAMES]


FIGURE3 = Experiment(
    title="Figure 3: footage",
    text="Each learner sees 700 frames of one drive once, in order, and is tested on 700 of "
    "another drive of the same place. Simulated: two drives of a teacher with different "
    "starts, noise and slips of the hand, in the places of the three trials. Recorded: real "
    "cars driven by people, where a folder of recordings is given.",
    plan=_plan,
    tables=_tables,
    drawn=("mean", "paper mean"),
)
