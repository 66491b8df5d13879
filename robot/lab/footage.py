"""Figure 3 without a robot: trained on one drive, how much of another is classified correctly?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from robot.control.state import Tick
from robot.lab.evaluation import Pair, evaluate, scores
from robot.lab.ideas import make_learner
from robot.lab.pilots import make_pilot
from robot.lab.task import Result
from robot.lab.trial import FRAME_RATE_HZ, Place, Trial
from robot.policy.registry import make_policy
from robot.types import Action, Frame, Mode

FRAMES = 700
"""Frames to train on, and as many to test on, as in the paper."""

_Footage = list[tuple[Frame, Action]]


def run_simulated_footage(params: Mapping[str, Any]) -> Result:
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
    return _judged([label for _, label in test], proposed)


def run_recorded_footage(params: Mapping[str, Any]) -> Result:
    """Train on one recording, test on another; `train`, `test` (paths) and `learner`."""
    from robot.exchange.npz import load_recording  # of another house, asked for when needed

    pair = Pair(train=load_recording(params["train"]), test=load_recording(params["test"]))
    result = next(iter(evaluate([pair], [params["learner"]])))
    names = ("correct", "frames", "accuracy", "balanced_accuracy", "calibration_error")
    return {name: getattr(result, name) for name in names}


def recorded_pairs(folder: Path) -> list[tuple[str, str]]:
    """Return the paths of each place's two recordings, both ways; empty if there is no folder."""
    pairs = []
    for first in sorted(folder.glob("*_A.npz")):
        second = first.with_name(first.name.replace("_A.npz", "_B.npz"))
        if second.is_file():
            pairs += [(str(first), str(second)), (str(second), str(first))]
    return pairs


def _film(params: Mapping[str, Any], moves: tuple[Action, ...]) -> _Footage:
    footage: _Footage = []

    def note(tick: Tick) -> None:
        held = tick.commands[-1].held if tick.commands else None
        if tick.frame is not None and held is not None:
            footage.append((tick.frame, held))

    place = Place(world=params["world"], seed=params["seed"])
    with Trial(place, make_policy("published-1", moves=moves), make_pilot(params, moves)) as trial:
        trial.loop.subscribe(note)
        while len(footage) < FRAMES:
            trial.drive(Mode.TRAIN, 5.0 * 10.0 / FRAME_RATE_HZ)
    return footage[:FRAMES]


def _judged(truth: Sequence[Action], proposed: Sequence[Action | None]) -> Result:
    accuracy, balanced = scores(truth, proposed)
    return {
        "correct": round(accuracy * len(truth)),
        "frames": len(truth),
        "accuracy": accuracy,
        "balanced_accuracy": balanced,
    }
