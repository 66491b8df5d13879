"""Other people's learners behind the same interface, for comparison and for teaching."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot.errors import need
from robot.lab.baselines.baseline import Baseline
from robot.policy.action_filter import ActionFilter
from robot.policy.features import Features, GradientFeatures, GreyFeatures
from robot.policy.policy import Policy
from robot.policy.registry import split_name
from robot.types import Action


def make_baseline(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a baseline on the paper's pictures; a `Maker`. The number is of neighbours."""
    return _unfiltered(number, name, moves, GreyFeatures())


def make_rival(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a baseline with the default's features and running average."""
    return Policy(name, number, _make(name, number), GradientFeatures(), moves=moves)


def make_network(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a network on small colour pictures; a `Maker`. The number is of hidden units."""
    from robot.lab.baselines.networks import ColourFeatures

    return _unfiltered(number, name, moves, ColourFeatures())


def _unfiltered(number: int, name: str, moves: tuple[Action, ...], features: Features) -> Policy:
    learner = _make(name, number)
    return Policy(name, number, learner, features, moves=moves, action_filter=ActionFilter.none)


def _make(name: str, number: int) -> Baseline:
    """Return the baseline of a learner's name.

    Raises:
        MissingExtraError: If its library is not installed.
    """
    kind = split_name(name)[0].removeprefix("fair-")
    make = _KINDS[kind](number)
    return Baseline(kind, number, make, is_eager=kind in ("knn", "trees"))


def _knn(number: int) -> Callable[[int], Any]:
    make = need("sklearn.neighbors", "the learner knn", "evaluate").KNeighborsClassifier
    return lambda n_examples: make(min(number, n_examples), algorithm="brute")


def _trees(number: int) -> Callable[[int], Any]:
    """Make extremely randomized trees (Geurts and others, 2006): a strong batch learner."""
    make = need("sklearn.ensemble", "the learner trees", "evaluate").ExtraTreesClassifier
    return lambda n_examples: make(number, random_state=0, min_samples_leaf=2)


def _perceptron(number: int) -> Callable[[int], Any]:
    from robot.lab.baselines.networks import BatchClassifier

    make = need("sklearn.neural_network", "the learner mlp", "learners").MLPClassifier
    return lambda n_examples: BatchClassifier(make((number,), random_state=0))


def _convolution(number: int) -> Callable[[int], Any]:
    from robot.lab.baselines.networks import BatchClassifier, ConvolutionalNetwork

    return lambda n_examples: BatchClassifier(ConvolutionalNetwork(number))


_KINDS = {"knn": _knn, "trees": _trees, "mlp": _perceptron, "cnn": _convolution}
