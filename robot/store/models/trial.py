"""Tries an untrusted model before it is accepted: it must match its summary, drive, and learn.

The content of each part of the model must match its declaration (`robot/learner/part.py`). Memory
is never allocated according to lengths that the model declares. After all checks, a copy of the
model drives and learns on a few pictures.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import cycle

import numpy as np

from robot.clock import RealClock
from robot.errors import RecordingError
from robot.policy.autosize import sample_frames
from robot.policy.policy import Policy
from robot.store.models.model import Model
from robot.types import Action

_MACHINE = RealClock()

TRIAL_S = 2.0
"""Time for which a trial shows pictures to the model's policy, in seconds. On a slow computer fewer
pictures are shown, but at least one. Slowness is never a reason to refuse a valid model."""
_PICTURES = 6
_STEP_S = 0.15
_MOST_MOVES = 32
_pictures = cache(sample_frames)


def try_model(model: Model) -> None:
    """Raise RecordingError for any model that cannot be used."""
    try:
        with np.errstate(all="ignore"):  # warnings are needless, because results are checked
            _check_summary(model)
            policy = model.to_policy()
            policy.check()
            _drive(policy)
            policy.check()
    except RecordingError:
        raise
    except Exception as error:  # the plugin of a learner may raise any error
        raise RecordingError(f"the model is invalid: {str(error)[:250] or repr(error)}") from error


def _check_summary(model: Model) -> None:
    summary = model.summary
    moves = tuple(summary.moves)
    _demand(0 < len(moves) <= _MOST_MOVES, "it names no moves, or too many")
    _demand(len(set(moves)) == len(moves) and Action.STOP not in moves, "its moves are not unique")
    _demand(set(summary.taught) <= set(moves), "it was taught moves that it does not name")
    _demand(set(map(str, model.state.labels)) <= set(moves), "it has labels that are not moves")


def _drive(policy: Policy) -> None:
    """Let the policy predict and learn on some pictures, with each move as its current move."""
    until_s = _MACHINE.now_s() + TRIAL_S
    moves = cycle((*policy.moves, None))
    for i, frame in enumerate(_pictures(_PICTURES)):
        x, at_s = policy.extract(frame), i * _STEP_S
        for under_way in (None, next(moves)):
            shown = policy.propose(i, x, under_way=under_way, at_s=at_s)
            values = [shown.confidence, shown.novelty, *shown.probabilities.values()]
            _demand(all(map(math.isfinite, values)), "the output for a picture is not a number")
        policy.learn(x, policy.moves[i % len(policy.moves)], at_s)
        if _MACHINE.now_s() > until_s:
            break
    for node in policy.learner.nodes():  # check every node, because the page shows every node
        policy.features.thumbnail(node.image)
        _demand(set(node.votes) <= set(policy.moves), "an image has votes for unknown moves")
    policy.reset()


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise RecordingError(f"the model is invalid: {otherwise}")
