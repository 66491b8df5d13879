"""Makes policies by name, such as `default-32`: a learner with its features and action filter.

Each entry point of the group `drivelesson.learners` is a `Maker`, which makes one kind of policy.
"""

from __future__ import annotations

import platform
import re
from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint

from robot.entry_points import points
from robot.errors import ConfigurationError, MissingExtraError, PluginError, did_you_mean
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import ContextRidge
from robot.policy.action_filter import ActionFilter
from robot.policy.features import GradientFeatures, GreyFeatures
from robot.policy.policy import Policy
from robot.types import DEFAULT_MOVES, Action

LEARNERS = "drivelesson.learners"
VARIANTS = "drivelesson.variants"
"""Entry points of the default learner's variants, which are for experiments. Each variant differs
from the default in one part. Lists of learners do not contain variants."""
DEFAULT_NODES = 32
MOST_NODES = 1024
"""Maximum number of images of a learner. The table of distances has the square of this size."""

Maker = Callable[[int, str, tuple[Action, ...], bool], Policy]
"""Makes a policy. The arguments are the number of nodes, the name, the moves, and whether to
compute in integers only."""
BALANCE = 0.2
"""Extra weight of rare labels, so that few examples of a turn are enough to learn the turn."""


def make_default(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Make the policy whose robots drove best. If `integer` is set, it has no linear part, because
    recursive least squares needs floating-point operations for each pair of gradients."""
    features = GradientFeatures()
    linear = None if integer else ContextRidge(features.n_gradients, alike=features.alike())
    learner = BSOCClassifier(
        number, linear=linear, balance=BALANCE, integer=integer, forgets=not integer
    )
    brighten = None if integer else features.brightened
    return Policy(
        name, number, learner, features, moves=moves, brighten=brighten, knows_repeats=not integer
    )


def make_published(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Make the paper's policy, as published."""
    learner = BSOCClassifier.published(number, integer=integer)
    return Policy(
        name, number, learner, GreyFeatures(), moves=moves, action_filter=ActionFilter.none
    )


@cache
def _points() -> dict[str, EntryPoint]:
    return {point.name: point for group in (LEARNERS, VARIANTS) for point in points(group)}


def learner_kinds() -> list[str]:
    """Return the names of the installed kinds of learners, sorted, without `VARIANTS`."""
    return sorted(point.name for point in _points().values() if point.group == LEARNERS)


def is_learner_kind(kind: str) -> bool:
    """True if a kind of learner, or a variant, has this name."""
    return kind in _points()


def make_policy(name: str = "default-32", moves: tuple[Action, ...] = DEFAULT_MOVES) -> Policy:
    """Return a policy by its name, KIND-NUMBER: `default-32`, `published-64`, `knn-9`.

    On a machine without a floating-point unit the policy compares pixels in integers.

    Args:
        name: The kind of learner, and its number of nodes (or of nearest neighbours).
        moves: The moves that the policy may propose.

    Raises:
        ConfigurationError: If there is no such learner.
        MissingExtraError: If a library that the learner needs is not installed.
        PluginError: If the learner's package cannot be loaded.
    """
    kind, number = split_name(name)
    if kind not in _points():
        raise ConfigurationError(
            f"unknown learner {name!r}{did_you_mean(kind, _points())}; choose one of: "
            f"{', '.join(f'{kind}-NUMBER' for kind in learner_kinds())}"
        )
    try:
        maker: Maker = _points()[kind].load()
    except MissingExtraError:
        raise
    except (ImportError, AttributeError) as error:
        raise PluginError(f"the learner {kind!r} cannot be loaded: {error}") from error
    # ARMv5 processors have no floating-point unit.
    is_whole = platform.machine().startswith("armv5")
    return maker(number, name, moves, is_whole)


def split_name(name: str) -> tuple[str, int]:
    """Return the kind and the number in a learner's name.

    Raises:
        ConfigurationError: If the name is not KIND-NUMBER with a number of at least 1.
    """
    match = re.fullmatch(r"(.+)-([1-9][0-9]{0,5})", name)
    if match is None or int(match[2]) > MOST_NODES:
        raise ConfigurationError(
            f"a learner's name must be KIND-NUMBER, such as default-32, with a number from 1 to "
            f"{MOST_NODES}, not {name[:80]!r}; kinds: "
            f"{', '.join(learner_kinds())}"
        )
    return match[1], int(match[2])


def full_name(learner: str, number: object, default: object) -> str:
    """Return KIND-NUMBER. NUMBER is `number`, or the number in `learner`, or the default."""
    kind, _, own = learner.rpartition("-")
    if not own.isdecimal():
        kind, own = learner, ""
    return f"{kind}-{number or own or default}"
