"""The default learner, and the same without one of its parts: what is each part worth?

`drivelesson bench ablation` compares them on recorded footage, `drivelesson experiment ablation`
in closed loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from robot.features import Features, GradientFeatures, GreyFeatures
from robot.learner.classifier import GROUP_COST, LINEAR_SHARE, N_VOTERS, BSOCClassifier
from robot.learner.ridge import RecursiveRidge
from robot.policy import Policy
from robot.steadiness import Commitment, Steadiness
from robot.types import Action

Maker = Callable[[int, str, tuple[Action, ...], bool], Policy]
"""Makes a policy of a number of nodes, a name and the moves; True: in whole numbers alone."""


def default_learner(number: int, integer: bool) -> BSOCClassifier:
    """Return the default's learner alone."""
    return _learner(number, integer)


def make_default(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return the default: every constant as measured best."""
    return Policy(name, number, _learner(number, integer), GradientFeatures(), moves=moves)


def _learner(
    number: int,
    integer: bool,
    *,
    is_linear: bool = True,
    linear_share: float = LINEAR_SHARE,
    group_cost: float = GROUP_COST,
    n_voters: int = N_VOTERS,
) -> BSOCClassifier:
    # The linear part costs a floating-point step over all pairs of gradients a lesson.
    ridge = RecursiveRidge(GradientFeatures.n_gradients) if is_linear and not integer else None
    return BSOCClassifier(
        number,
        group_cost=group_cost,
        n_voters=n_voters,
        linear=ridge,
        linear_share=linear_share,
        integer=integer,
    )


def _variant(
    *,
    features: type[Features] = GradientFeatures,
    steadiness: Callable[[], Steadiness] = Steadiness,
    is_linear: bool = True,
    linear_share: float = LINEAR_SHARE,
    group_cost: float = GROUP_COST,
    n_voters: int = N_VOTERS,
) -> Maker:
    def make(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
        learner = _learner(
            number,
            integer,
            is_linear=is_linear,
            linear_share=linear_share,
            group_cost=group_cost,
            n_voters=n_voters,
        )
        return Policy(name, number, learner, features(), moves=moves, steadiness=steadiness())

    return make


def _whole_numbers(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    return make_default(number, name, moves, True)


VARIANTS: dict[str, Maker] = {
    "without-linear": _variant(is_linear=False),
    "linear-alone": _variant(linear_share=1.0),
    "labels-merged-freely": _variant(group_cost=1.0),
    "one-voter": _variant(n_voters=1),
    "without-average": _variant(steadiness=lambda: Steadiness(votes_kept=0.0)),
    "without-commitment": _variant(
        steadiness=lambda: Steadiness(commitment=Commitment(bars_opposite=False))
    ),
    "without-inertia": _variant(steadiness=lambda: Steadiness(commitment=Commitment(0.0, 0.0))),
    "without-reflex": _variant(steadiness=lambda: Steadiness(unfamiliar=math.inf)),
    "grey-alone": _variant(features=GreyFeatures, is_linear=False),
    "whole-numbers": _whole_numbers,
}
"""The default with one thing changed, by the kind that names it."""
