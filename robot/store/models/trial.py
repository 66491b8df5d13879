"""Tries a model from anywhere before it is taken: it must be what it says, drive, and learn.

What its parts may hold is what they declare (`robot/learner/part.py`). Nothing is made of a size
that the model claims; then a copy of it is driven and taught on a few pictures.
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
"""Of the pictures so many are shown as there is time for, and always the first: a slow computer
refuses nothing."""
_PICTURES = 6
_STEP_S = 0.15
_MOST_MOVES = 32
_pictures = cache(sample_frames)


def try_model(model: Model) -> None:
    """Refuse a model that cannot be used, whatever is wrong with it, by a RecordingError."""
    try:
        with np.errstate(all="ignore"):  # what comes of it is judged
            _check_summary(model)
            policy = model.to_policy()
            policy.check()
            _drive(policy)
            policy.check()
    except RecordingError:
        raise
    except Exception as error:  # its learner may be anybody's
        raise RecordingError(f"the model is invalid: {str(error)[:250] or repr(error)}") from error


def _check_summary(model: Model) -> None:
    summary = model.summary
    moves = tuple(summary.moves)
    _demand(0 < len(moves) <= _MOST_MOVES, "it names no moves, or too many")
    _demand(len(set(moves)) == len(moves) and Action.STOP not in moves, "its moves are not unique")
    _demand(set(summary.taught) <= set(moves), "it was taught moves that it does not name")
    _demand(set(map(str, model.state.labels)) <= set(moves), "it has labels that are no moves")


def _drive(policy: Policy) -> None:
    """Show some pictures, each with another move under way, and teach each of them."""
    until_s = _MACHINE.now_s() + TRIAL_S
    moves = cycle((*policy.moves, None))
    for i, frame in enumerate(_pictures(_PICTURES)):
        x, at_s = policy.extract(frame), i * _STEP_S
        for under_way in (None, next(moves)):
            shown = policy.propose(i, x, under_way=under_way, at_s=at_s)
            values = [shown.confidence, shown.novelty, *shown.probabilities.values()]
            _demand(all(map(math.isfinite, values)), "what it makes of a picture is no number")
        policy.learn(x, policy.moves[i % len(policy.moves)], at_s)
        if _MACHINE.now_s() > until_s:
            break
    for node in policy.learner.nodes():  # as a page shows them
        policy.features.thumbnail(node.image)
        _demand(set(node.votes) <= set(policy.moves), "an image has votes for no move")
    policy.reset()


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise RecordingError(f"the model is invalid: {otherwise}")
