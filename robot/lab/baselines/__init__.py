"""Third-party learners behind the same interface, for comparison and for teaching."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from robot.errors import need
from robot.lab.baselines.baseline import AngleBaseline, AnglePolicy, Baseline
from robot.lab.baselines.networks import BatchNetwork, ColourFeatures, ConvolutionalNetwork
from robot.lab.baselines.of_the_paper import RotatingSet, gng, som
from robot.policy.action_filter import ActionFilter
from robot.policy.features import Features, GradientFeatures, GreyFeatures
from robot.policy.policy import Policy
from robot.policy.registry import split_name
from robot.types import Action


@dataclass(frozen=True, slots=True, kw_only=True)
class BaselineKind:
    """A kind of learner from another library.

    Attributes:
        make: Returns a new model. Its arguments are the library's class, the number at the end of
            the learner's name (5 in `knn-5`), and the number of examples. The number in the name is
            a number of neighbours, trees or hidden units, or a penalty.
        library: Module, class, and the extra that installs the library.
        features: The learner's features. For a fair comparison, a learner with gradient features,
            like the default learner, also gets the default learner's action filter. A learner with
            grey values or colours gets none.
        is_eager: True if the learner is fitted again after every example; False if only whenever
            the number of examples has grown by a tenth.
        is_angular: True if the learner learns only the angle, by regression.
    """

    make: Callable[[Any, int, int], Any]
    library: tuple[str, str, str] | None = None
    features: Callable[[], Features] = GradientFeatures
    is_eager: bool = False
    is_angular: bool = False


def _neighbours(make: Any, number: int, n_examples: int) -> Any:
    return make(min(number, n_examples), algorithm="brute")


_KNN = ("sklearn.neighbors", "KNeighborsClassifier", "evaluate")
BASELINES = {
    "knn": BaselineKind(make=_neighbours, library=_KNN, features=GreyFeatures, is_eager=True),
    "fair-knn": BaselineKind(make=_neighbours, library=_KNN, is_eager=True),
    # Extremely randomized trees (Geurts and others, 2006) are a strong batch learner.
    "fair-trees": BaselineKind(
        make=lambda make, number, n_examples: make(number, random_state=0, min_samples_leaf=2),
        library=("sklearn.ensemble", "ExtraTreesClassifier", "evaluate"),
        is_eager=True,
    ),
    "som": BaselineKind(make=som, library=("minisom", "MiniSom", "rivals"), features=GreyFeatures),
    "gng": BaselineKind(make=gng, library=("minigng", "MiniGNG", "rivals"), features=GreyFeatures),
    "alvinn": BaselineKind(
        make=lambda make, number, n_examples: RotatingSet(make((number,), random_state=0)),
        library=("sklearn.neural_network", "MLPClassifier", "rivals"),
        features=GreyFeatures,
    ),
    "mlp": BaselineKind(
        make=lambda make, number, n_examples: BatchNetwork(make((number,), random_state=0)),
        library=("sklearn.neural_network", "MLPClassifier", "learners"),
        features=ColourFeatures,
    ),
    "cnn": BaselineKind(
        make=lambda make, number, n_examples: BatchNetwork(ConvolutionalNetwork(number)),
        features=ColourFeatures,
    ),
    "angle-knn": BaselineKind(
        make=_neighbours,
        library=("sklearn.neighbors", "KNeighborsRegressor", "evaluate"),
        is_eager=True,
        is_angular=True,
    ),
    "angle-ridge": BaselineKind(
        make=lambda make, number, n_examples: make(number * 255.0**2),
        library=("sklearn.linear_model", "Ridge", "evaluate"),
        is_angular=True,
    ),
    # This network is similar to donkeycar's `linear`.
    "angle-cnn": BaselineKind(
        make=lambda make, number, n_examples: BatchNetwork(
            ConvolutionalNetwork(number, has_softmax=False)
        ),
        features=ColourFeatures,
        is_angular=True,
    ),
}


def make_baseline(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return a policy with the third-party learner of this name. This function is a `Maker`.
    Raises MissingExtraError if the learner's library is not installed."""
    kind = split_name(name)[0]
    baseline, make = BASELINES[kind], None
    if baseline.library is not None:
        module, class_name, extra = baseline.library
        make = getattr(need(module, f"the learner {kind}", extra), class_name)
    learner = (AngleBaseline if baseline.is_angular else Baseline)(
        kind.removeprefix("fair-"),
        number,
        lambda n_examples: baseline.make(make, number, n_examples),
        is_eager=baseline.is_eager,
    )
    policy = AnglePolicy if baseline.is_angular else Policy
    features = baseline.features()
    is_fair = isinstance(features, GradientFeatures)
    action_filter = ActionFilter if is_fair else ActionFilter.none
    return policy(name, number, learner, features, moves=moves, action_filter=action_filter)
