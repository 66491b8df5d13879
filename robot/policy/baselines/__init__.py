"""Other people's learners behind the same interface, for comparison and for teaching."""

from __future__ import annotations

from robot.learner.base import Learner


def make(kind: str, number: int) -> Learner:
    """Return a baseline; its library is imported only now.

    Raises:
        MissingExtraError: If that library is not installed.
        LookupError: If there is no such kind.
    """
    if kind == "knn":
        from robot.policy.baselines.refitted import NearestNeighbours

        return NearestNeighbours(number)
    if kind == "trees":
        from robot.policy.baselines.refitted import ExtraTrees

        return ExtraTrees(number)
    if kind == "som":
        from robot.policy.baselines.som import SelfOrganizingMap

        return SelfOrganizingMap(number)
    if kind == "gas":
        from robot.policy.baselines.gas import GrowingNeuralGas

        return GrowingNeuralGas(number)
    if kind == "alvinn":
        from robot.policy.baselines.alvinn import ReplayNetwork

        return ReplayNetwork(number)
    if kind == "sgd":
        from robot.policy.baselines.online import LinearOnline

        return LinearOnline()
    if kind == "river":
        from robot.policy.baselines.online import RiverSoftmax

        return RiverSoftmax()
    raise LookupError(f"unknown baseline {kind!r}")
