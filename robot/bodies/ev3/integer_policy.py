"""The default learner in whole numbers, for a brick without a floating-point unit."""

from __future__ import annotations

from robot.bodies.ev3.integer_features import IntegerGradientFeatures
from robot.bodies.ev3.integer_ridge import IntegerRidge
from robot.learner.bsoc import BSOC
from robot.learner.classifier import GROUP_COST, BSOCClassifier
from robot.learner.integer_images import IntegerImages
from robot.policy.policy import Policy
from robot.types import Action


def make_integer(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return the default learner in whole numbers, identical bit for bit on every machine."""
    features = IntegerGradientFeatures()
    ridge = IntegerRidge(features.n_gradients)
    images = IntegerImages(number, features.n_compared)
    nodes = BSOC(number, group_cost=GROUP_COST, images=images)
    learner = BSOCClassifier(number, linear=ridge, cluster=nodes)
    return Policy(name, number, learner, features, moves=moves)
