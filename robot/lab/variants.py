"""Variants of the default learner, each with one part changed, to measure the effect of this part.

`drivelesson experiment ablation` compares the variants. Each variant is an entry point in the group
`drivelesson.variants`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from robot.learner.base import Vector
from robot.learner.classifier import GROUP_COST, LINEAR_SHARE, N_VOTERS, BSOCClassifier
from robot.learner.ridge import ContextRidge, RecursiveRidge
from robot.policy.action_filter import ActionFilter
from robot.policy.features import Features, GradientFeatures, GreyFeatures
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import Seen
from robot.policy.pilot_pace import PilotPace
from robot.policy.policy import Policy
from robot.policy.registry import BALANCE, split_name
from robot.types import Action, Prediction


class NoClock(ActionFilter):
    """An action filter for comparison. Unlike the normal filter, this one never weakens a turn that
    lasts too long."""

    def _watch(self, *seen: Any) -> float:
        super()._watch(*seen)
        return 0.0


class NoPace(ActionFilter):
    """An action filter that does not adapt to the pilot's pace: all pilots seem equally fast."""

    def on_frame(self, seen: Seen) -> None:
        self.pace = PilotPace(self._kinds)
        super().on_frame(seen)


class MovePolicy(Policy):
    """A policy that steers only by each move's mean steering. A comparison with this policy shows
    what the learned steering angle contributes."""

    def propose(self, frame_id: int, x: Vector, **seen: Any) -> Prediction:
        said = super().propose(frame_id, x, **seen)
        if said.action is None or said.point is None:
            return said
        return replace(said, point=self.usual_point(said.action))


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The parts and constants of a learner; the defaults are those of `make_default`."""

    features: Callable[[], Features] = GradientFeatures
    action_filter: Callable[[MoveKinds], ActionFilter] = ActionFilter
    is_linear: bool = True
    is_smooth: bool = True
    """True if the linear part expects similar weights in adjacent cells (`GradientFeatures`)."""
    is_contextual: bool = True
    """True if the linear part also takes the current move into account; otherwise the filter
    favours the current move."""
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
        # For each example, the linear part makes a floating-point operation for each pair of
        # features. Without a floating-point unit, this takes too long.
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


VARIANTS: dict[str, Design] = {
    "without-linear": Design(is_linear=False),
    "linear-alone": Design(linear_share=1.0),
    "labels-merged-freely": Design(group_cost=1.0),
    "one-voter": Design(n_voters=1),
    "without-average": Design(action_filter=lambda kinds: ActionFilter(kinds, votes_kept=0.0)),
    "without-filter": Design(action_filter=ActionFilter.none),
    "without-clock": Design(action_filter=NoClock),
    "without-pace": Design(action_filter=NoPace),
    "without-rate": Design(thins=False),
    "without-repeats": Design(knows_repeats=False),
    "without-balance": Design(balance=0.0),
    "without-smoothness": Design(is_smooth=False),
    "without-context": Design(is_contextual=False),
    "without-reflex": Design(action_filter=lambda kinds: ActionFilter(kinds, gives_up=False)),
    "without-forgetting": Design(forgets=False),
    "without-adaptation": Design(adapts=False),
    "without-angle": Design(policy=MovePolicy),
    "grey-alone": Design(features=GreyFeatures, is_linear=False),
    "whole-numbers": Design(is_integer=True),
}
"""Maps each variant's name to its design, which is the default learner with one change."""


def make_variant(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    return VARIANTS[split_name(name)[0]].make(number, name, moves, integer)
