"""Variants of the default learner, each without one of its parts, to measure the effect of this
part.

`drivelesson experiment ablation` compares the variants. Each variant is an entry point in the group
`drivelesson.variants`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from robot.learner.base import Vector
from robot.policy.action_filter import ActionFilter
from robot.policy.features import GreyFeatures
from robot.policy.part import Seen
from robot.policy.pilot_pace import PilotPace
from robot.policy.policy import Policy
from robot.policy.registry import Design, split_name
from robot.types import Action, Prediction


class NoClock(ActionFilter):
    """A variant of the action filter that never takes votes from a turn, however long the turn
    lasts."""

    def _watch(self, *seen: Any) -> float:
        super()._watch(*seen)
        return 0.0


class NoPace(ActionFilter):
    """Assumes that all pilots drive at the same pace."""

    def on_frame(self, seen: Seen) -> None:
        self.pace = PilotPace(self._kinds)
        super().on_frame(seen)


class MovePolicy(Policy):
    """Steers by each move's mean steering, to measure the effect of the learned angle."""

    def propose(self, frame_id: int, x: Vector, **seen: Any) -> Prediction:
        said = super().propose(frame_id, x, **seen)
        if said.action is None or said.point is None:
            return said
        return replace(said, point=self.usual_point(said.action))


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
