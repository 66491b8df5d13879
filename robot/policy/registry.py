"""Makes learners by name, each with features and an action filter: `default-32`, `published-64`.

A kind of learner is an entry point, a `Maker`, in the group `drivelesson.learners`.
"""

from __future__ import annotations

import platform
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint

from robot.entry_points import points
from robot.errors import ConfigurationError, MissingExtraError, PluginError, did_you_mean
from robot.learner.classifier import GROUP_COST, LINEAR_SHARE, N_VOTERS, BSOCClassifier
from robot.learner.ridge import ContextRidge, RecursiveRidge
from robot.policy.action_filter import ActionFilter
from robot.policy.features import Features, GradientFeatures, GreyFeatures
from robot.policy.move_kinds import MoveKinds
from robot.policy.policy import Policy
from robot.types import DEFAULT_MOVES, Action

LEARNERS = "drivelesson.learners"
VARIANTS = "drivelesson.variants"
"""Entry points of variants of the default learner for experiments, each with one change. Lists of
learners do not contain variants."""
DEFAULT_NODES = 32
MOST_NODES = 1024
"""Maximum number of images of a learner: the table of distances grows with its square."""

Maker = Callable[[int, str, tuple[Action, ...], bool], Policy]
"""Makes a policy. The arguments are the number of nodes, the name, the moves, and whether to
compute in integers only."""
BALANCE = 0.2
"""Extra weight of rare labels, so that few examples of a turn are enough to learn the turn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The parts and constants of a learner; the defaults are the values that drove best."""

    features: Callable[[], Features] = GradientFeatures
    action_filter: Callable[[MoveKinds], ActionFilter] = ActionFilter
    is_linear: bool = True
    is_smooth: bool = True
    """True if the linear part expects similar weights in adjacent cells (`GradientFeatures`)."""
    is_contextual: bool = True
    """True if the current move is an input of the linear part; if False, the move has inertia."""
    linear_share: float = LINEAR_SHARE
    group_cost: float = GROUP_COST
    n_voters: int = N_VOTERS
    balance: float = BALANCE
    is_integer: bool = False
    """True if the learner computes in integers only, on any machine."""
    forgets: bool = True
    thins: bool = True
    knows_repeats: bool = True
    adapts: bool = True
    policy: type[Policy] = Policy

    def make(self, number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
        """Return the policy; a `Maker`."""
        features, is_whole = self.features(), integer or self.is_integer
        # The linear part takes a floating-point step for each pair of gradients in each example.
        ridge = ContextRidge if self.is_contextual else RecursiveRidge
        is_linear = self.is_linear and not is_whole
        alike = GradientFeatures.alike() if self.is_smooth else None
        learner = BSOCClassifier(
            number,
            group_cost=self.group_cost,
            n_voters=self.n_voters,
            linear=ridge(GradientFeatures.n_gradients, alike=alike) if is_linear else None,
            linear_share=self.linear_share,
            balance=self.balance,
            integer=is_whole,
            forgets=self.forgets and not is_whole,
        )
        brighten = None
        if self.adapts and not integer and isinstance(features, GradientFeatures):
            brighten = features.brightened
        return self.policy(
            name,
            number,
            learner,
            features,
            moves=moves,
            action_filter=self.action_filter,
            thins=self.thins,
            brighten=brighten,
            knows_repeats=self.knows_repeats and not is_whole,
        )


make_default = Design().make


def make_published(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return the paper's learner, as published; a `Maker`."""
    learner = BSOCClassifier.published(number, integer=integer)
    return Policy(
        name, number, learner, GreyFeatures(), moves=moves, action_filter=ActionFilter.none
    )


@cache
def _points() -> dict[str, EntryPoint]:
    return {point.name: point for group in (LEARNERS, VARIANTS) for point in points(group)}


def learner_kinds() -> list[str]:
    """Return the installed kinds of learners, sorted, without the variants."""
    return sorted(point.name for point in _points().values() if point.group == LEARNERS)


def is_learner_kind(kind: str) -> bool:
    """True if a kind of learner, or a variant, has this name."""
    return kind in _points()


def make_policy(name: str = "default-32", moves: tuple[Action, ...] = DEFAULT_MOVES) -> Policy:
    """Return a policy by its name, KIND-NUMBER: `default-32`, `published-64`, `knn-9`.

    On a machine without a floating-point unit the policy compares pixels in integers.

    Args:
        name: The kind of learner, and its number of nodes (or of neighbours).
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
    """Return KIND-NUMBER. NUMBER is `number`, else the number in `learner`, else the default."""
    kind, _, own = learner.rpartition("-")
    if not own.isdecimal():
        kind, own = learner, ""
    return f"{kind}-{number or own or default}"
