"""The design of a learner: its parts and constants, with the default's as the defaults."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from robot.learner.classifier import GROUP_COST, LINEAR_SHARE, N_VOTERS, BSOCClassifier
from robot.learner.context_ridge import ContextRidge
from robot.learner.ridge import LinearPart, RecursiveRidge
from robot.policy.action_filter import ActionFilter
from robot.policy.features import Features, GradientFeatures
from robot.policy.move_kinds import MoveKinds
from robot.policy.policy import Policy
from robot.types import Action

Maker = Callable[[int, str, tuple[Action, ...], bool], Policy]
"""Makes a policy of a number of nodes, a name and the moves; True: in whole numbers alone."""


BALANCE = 0.2
"""By how much a rare label weighs more: few examples of a turn are enough to see it."""


def _ridge() -> RecursiveRidge:
    return RecursiveRidge(GradientFeatures.n_gradients)


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The parts and constants of a learner; the defaults are those that measured best."""

    features: Callable[[], Features] = GradientFeatures
    action_filter: Callable[[MoveKinds], ActionFilter] = ActionFilter
    is_linear: bool = True
    is_contextual: bool = True
    """The linear part knows what is under way; else the move under way has inertia."""
    linear_share: float = LINEAR_SHARE
    group_cost: float = GROUP_COST
    n_voters: int = N_VOTERS
    balance: float = BALANCE
    is_integer: bool = False
    """Whole numbers alone, on any machine."""
    forgets: bool = True
    thins: bool = True
    adapts: bool = True
    policy: type[Policy] = Policy

    def make_learner(self, number: int, integer: bool) -> BSOCClassifier:
        """Return the learner alone, of at most `number` nodes."""
        integer = integer or self.is_integer
        # The linear part costs a floating-point step over all pairs of gradients an example.
        linear: LinearPart | None = None
        if self.is_linear and not integer:
            linear = ContextRidge(_ridge) if self.is_contextual else _ridge()
        return BSOCClassifier(
            number,
            group_cost=self.group_cost,
            n_voters=self.n_voters,
            linear=linear,
            linear_share=self.linear_share,
            balance=self.balance,
            integer=integer,
            forgets=self.forgets and not integer,
        )

    def make(self, number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
        """Return the policy; a `Maker`."""
        learner, features = self.make_learner(number, integer), self.features()
        return self.policy(
            name,
            number,
            learner,
            features,
            moves=moves,
            action_filter=self.action_filter,
            thins=self.thins,
            brighten=(
                features.brightened
                if self.adapts and not integer and isinstance(features, GradientFeatures)
                else None
            ),
        )


DEFAULT = Design()
