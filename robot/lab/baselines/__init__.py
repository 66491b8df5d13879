"""Other people's learners behind the same interface, for comparison and for teaching."""

from __future__ import annotations

from robot.learner.base import Learner
from robot.policy.action_filter import ActionFilter
from robot.policy.features import GradientFeatures, GreyFeatures
from robot.policy.policy import Policy
from robot.policy.registry import split_name
from robot.types import Action


def make(kind: str, number: int) -> Learner:
    """Return a baseline; its library is imported only now.

    Raises:
        MissingExtraError: If that library is not installed.
        LookupError: If there is no such kind.
    """
    if kind == "knn":
        from robot.lab.baselines.refitted import NearestNeighbours

        return NearestNeighbours(number)
    if kind == "trees":
        from robot.lab.baselines.refitted import ExtraTrees

        return ExtraTrees(number)
    if kind == "mlp":
        from robot.lab.baselines.networks import Perceptron

        return Perceptron(number)
    if kind == "cnn":
        from robot.lab.baselines.networks import Convolution

        return Convolution(number)
    if kind == "som":
        from robot.lab.baselines.som import SelfOrganizingMap

        return SelfOrganizingMap(number)
    if kind == "gas":
        from robot.lab.baselines.gas import GrowingNeuralGas

        return GrowingNeuralGas(number)
    if kind == "alvinn":
        from robot.lab.baselines.alvinn import ReplayNetwork

        return ReplayNetwork(number)
    if kind == "sgd":
        from robot.lab.baselines.online import LinearOnline

        return LinearOnline()
    if kind == "river":
        from robot.lab.baselines.online import RiverSoftmax

        return RiverSoftmax()
    raise LookupError(f"unknown baseline {kind!r}")


def make_baseline(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a baseline on the paper's pictures; a `Maker`. The number is of neighbours for knn,
    of cells for som, of hidden units for alvinn, and of no consequence for sgd and river.
    """
    learner = make(split_name(name)[0], number)
    return Policy(
        name, number, learner, GreyFeatures(), moves=moves, action_filter=ActionFilter.none
    )


def make_rival(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a baseline with the default's features and running average."""
    kind = split_name(name)[0].removeprefix("fair-")
    return Policy(name, number, make(kind, number), GradientFeatures(), moves=moves)


def make_network(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a network on small colour pictures; a `Maker`. The number is of hidden units."""
    from robot.lab.baselines.networks import ColourFeatures

    learner, features = make(split_name(name)[0], number), ColourFeatures()
    return Policy(name, number, learner, features, moves=moves, action_filter=ActionFilter.none)
