"""Other people's learners behind the same interface, for comparison and for teaching."""

from __future__ import annotations

from importlib import import_module

from robot.learner.base import Learner
from robot.policy.action_filter import ActionFilter
from robot.policy.features import GradientFeatures, GreyFeatures
from robot.policy.policy import Policy
from robot.policy.registry import split_name
from robot.types import Action

_KINDS = {
    "knn": "refitted:NearestNeighbours",
    "trees": "refitted:ExtraTrees",
    "mlp": "networks:Perceptron",
    "cnn": "networks:Convolution",
    "som": "som:SelfOrganizingMap",
    "gas": "gas:GrowingNeuralGas",
    "alvinn": "alvinn:ReplayNetwork",
    "sgd": "online:LinearOnline",
    "river": "online:RiverSoftmax",
}
"""Module and class of each kind; imported, and its library with it, only when it is made."""


def _make(name: str, number: int) -> Learner:
    """Return the baseline of a learner's name.

    Raises:
        MissingExtraError: If its library is not installed.
    """
    module, _, made = _KINDS[split_name(name)[0].removeprefix("fair-")].partition(":")
    learner: Learner = getattr(import_module(f"robot.lab.baselines.{module}"), made)(number)
    return learner


def make_baseline(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a baseline on the paper's pictures; a `Maker`. The number is of neighbours for knn,
    of cells for som, of hidden units for alvinn, and of no consequence for sgd and river.
    """
    learner, features = _make(name, number), GreyFeatures()
    return Policy(name, number, learner, features, moves=moves, action_filter=ActionFilter.none)


def make_rival(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a baseline with the default's features and running average."""
    return Policy(name, number, _make(name, number), GradientFeatures(), moves=moves)


def make_network(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a network on small colour pictures; a `Maker`. The number is of hidden units."""
    from robot.lab.baselines.networks import ColourFeatures

    learner, features = _make(name, number), ColourFeatures()
    return Policy(name, number, learner, features, moves=moves, action_filter=ActionFilter.none)
