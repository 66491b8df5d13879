"""Learners by name, each with its features and its action filter: `default-32`, `published-64`."""

from __future__ import annotations

import os
import re

from robot.errors import ConfigurationError, did_you_mean
from robot.learner.bsoc import BSOC
from robot.learner.classifier import GROUP_COST, BSOCClassifier
from robot.learner.context_ridge import ContextRidge
from robot.learner.integer_ridge import IntegerRidge
from robot.learner.places import BinaryFeatures, MultiPlace
from robot.learner.ridge import RecursiveRidge
from robot.policy.action_filter import ActionFilter
from robot.policy.features import THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, GradientFeatures, GreyFeatures
from robot.policy.integer_features import IntegerGradientFeatures
from robot.policy.policy import Policy
from robot.policy.variants import DEFAULT, VARIANTS, Maker
from robot.types import DEFAULT_MOVES, Action

MOST_NODES = 1024
"""A learner of more images is refused: its table of distances grows with their square."""


def _published(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    learner = BSOCClassifier.published(number, integer=integer)
    return Policy(
        name, number, learner, GreyFeatures(), moves=moves, action_filter=ActionFilter.none()
    )


def _integer(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return the default's parts in whole numbers, the same bit for bit on every machine."""
    features = IntegerGradientFeatures()
    ridge = IntegerRidge(features.n_gradients)
    nodes = BSOC(number, group_cost=GROUP_COST, integer=True, n_compared=features.n_compared)
    learner = BSOCClassifier(number, linear=ridge, cluster=nodes)
    return Policy(name, number, learner, features, moves=moves)


def _multi_place(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    features = GradientFeatures()
    learner = MultiPlace(
        lambda: DEFAULT.make_learner(number, integer),
        BinaryFeatures(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH),
    )
    return Policy(name, number, learner, features, moves=moves)


def _eyes(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return the default's parts on what a frozen vision net sees; needs the extra `eyes`."""
    from robot.policy.eyes.features import EyesFeatures

    features = EyesFeatures()
    linear = ContextRidge(lambda: RecursiveRidge(features.n_outputs, penalty=EyesFeatures.penalty))
    learner = BSOCClassifier(
        number,
        linear=linear,
        balance=EyesFeatures.balance,
        novelty_margin=EyesFeatures.novelty_margin,
    )
    brighten = features.brightened
    return Policy(name, number, learner, features, moves=moves, calibrates=True, brighten=brighten)


def _baseline(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    from robot.policy import baselines

    learner = baselines.make(split_name(name)[0], number)
    return Policy(
        name, number, learner, GreyFeatures(), moves=moves, action_filter=ActionFilter.none()
    )


def _rival(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a baseline with the default's features and running average."""
    from robot.policy import baselines

    kind = split_name(name)[0].removeprefix("fair-")
    return Policy(name, number, baselines.make(kind, number), GradientFeatures(), moves=moves)


MAKERS: dict[str, Maker] = {
    "default": DEFAULT.make,
    "integer": _integer,
    "published": _published,
    "multi-place": _multi_place,
    "eyes": _eyes,
    "knn": _baseline,
    "fair-knn": _rival,
    "fair-trees": _rival,
    "som": _baseline,
    "gas": _baseline,
    "alvinn": _baseline,
    "sgd": _baseline,
    "river": _baseline,
    **VARIANTS,
}
"""Kinds of learners. The number is that of nodes; of neighbours for knn, of trees for fair-trees,
of cells for som, of hidden units for alvinn, of no consequence for sgd and river. `fair`: on the
default's features, with the default's average."""


def make_policy(
    name: str = "default-32",
    moves: tuple[Action, ...] = DEFAULT_MOVES,
    integer: bool | None = None,
) -> Policy:
    """Return a policy by its name, KIND-NUMBER: `default-32`, `published-64`, `knn-9`.

    Args:
        name: The kind of learner, and its number of nodes (or of neighbours).
        moves: What it may propose.
        integer: Compare pixels in whole numbers, for machines without a floating-point unit;
            None: if this machine has none.

    Raises:
        ConfigurationError: If there is no such learner.
        MissingExtraError: If a library that it needs is not installed.
    """
    kind, number = split_name(name)
    if kind not in MAKERS:
        raise ConfigurationError(
            f"unknown learner {name!r}{did_you_mean(kind, MAKERS)}; there are "
            f"{', '.join(f'{kind}-NUMBER' for kind in MAKERS if kind not in VARIANTS)}"
        )
    if integer is None:
        integer = os.uname().machine.startswith("armv5")  # the EV3's processor
    return MAKERS[kind](number, name, moves, integer)


def split_name(name: str) -> tuple[str, int]:
    """Return kind and number of a learner's name.

    Raises:
        ConfigurationError: If it is not KIND-NUMBER with a number of at least 1.
    """
    match = re.fullmatch(r"(.+)-([1-9]\d{0,5})", name)
    if match is None or int(match[2]) > MOST_NODES:
        raise ConfigurationError(
            f"a learner's name must be KIND-NUMBER, such as default-32, with a number from 1 to "
            f"{MOST_NODES}, not {name[:80]!r}; kinds: "
            f"{', '.join(kind for kind in MAKERS if kind not in VARIANTS)}"
        )
    return match[1], int(match[2])
