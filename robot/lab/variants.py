"""The default learner without one of its parts: what is each part worth?

`drivelesson bench ablation` compares them on recorded footage, `drivelesson experiment ablation`
in closed loop. Each is an entry point of `drivelesson.variants`.
"""

from __future__ import annotations

from robot.policy.action_filter import ActionFilter
from robot.policy.design import Design
from robot.policy.features import GreyFeatures
from robot.policy.policy import Policy
from robot.policy.registry import split_name
from robot.types import Action

VARIANTS: dict[str, Design] = {
    "without-linear": Design(is_linear=False),
    "linear-alone": Design(linear_share=1.0),
    "labels-merged-freely": Design(group_cost=1.0),
    "one-voter": Design(n_voters=1),
    "without-average": Design(action_filter=lambda kinds: ActionFilter(kinds, votes_kept=0.0)),
    "without-context": Design(is_contextual=False),
    "without-reflex": Design(action_filter=lambda kinds: ActionFilter(kinds, gives_up=False)),
    "without-forgetting": Design(forgets=False),
    "without-calibration": Design(calibrates=False),
    "without-adaptation": Design(adapts=False),
    "grey-alone": Design(features=GreyFeatures, is_linear=False),
    "whole-numbers": Design(is_integer=True),
}
"""The default with one thing changed, by the kind that names it."""


def make_variant(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    return VARIANTS[split_name(name)[0]].make(number, name, moves, integer)
