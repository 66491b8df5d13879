"""The default learner's parts on what a frozen vision net sees."""

from __future__ import annotations

from robot.lab.eyes.features import EyesFeatures
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import ContextRidge
from robot.policy.policy import Policy
from robot.types import Action


def make_eyes(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return the default's parts on what a frozen vision net sees; needs the extra `eyes`."""
    features = EyesFeatures()
    linear = ContextRidge(features.n_outputs, penalty=EyesFeatures.penalty)
    learner = BSOCClassifier(
        number,
        linear=linear,
        balance=EyesFeatures.balance,
        novelty_margin=EyesFeatures.novelty_margin,
    )
    brighten = features.brightened
    return Policy(name, number, learner, features, moves=moves, brighten=brighten)
