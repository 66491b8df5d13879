"""The protocol that every learner implements."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[Any]
"""A feature vector of shape (d,): float32 or uint8, finite, the same d on every call."""

Label = str
"""The name of a class: a plain string, or a member of an enum of strings."""


class NotFittedError(ValueError):
    """The learner cannot predict, because it has not learned any example yet."""


def checked_vector(x: Vector, n_features: int | None = None) -> Vector:
    """Return `x` as an array, if it is a valid vector.

    Raises:
        ValueError: If `x` is empty, is not a vector of finite numbers, or does not have
            `n_features` values.
    """
    array = np.asarray(x)
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"a feature vector must be 1-D and not empty; its shape is {array.shape}")
    if array.dtype.kind not in "fiub":
        raise ValueError(f"a feature vector must hold numbers, not {array.dtype}")
    if n_features is not None and array.size != n_features:
        raise ValueError(f"the vector has {array.size} values; the learner expects {n_features}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError("the vector has values that are not finite")
    return array


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """A prediction with its evidence.

    `probabilities` sum to 1. `confidence` is the calibrated probability that `label` is right.
    `novelty` is 0 for a familiar view, and 1 or more for a view unlike all learned views. Novelty
    is always 0 if the learner's `abilities` do not include it. `node` is the id of the nearest
    learned image; None if the learner stores no images. If the learner learned angles, `angle` is
    the predicted angle (about -1 to 1), `spread` its standard deviation, and `size` the mean
    magnitude of the learned angles. If the pilot turned to both sides at this view, `size` is large
    although `angle` is near 0.
    """

    label: Label
    probabilities: Mapping[Label, float]
    confidence: float
    novelty: float = 0.0
    node: int | None = None
    distance: float = 0.0
    angle: float | None = None
    size: float | None = None
    spread: float | None = None


class Mirror(NamedTuple):
    """How mirroring an image changes its feature vector and its label.

    Attributes:
        places: For each feature that the linear part uses, the index of its mirror image.
        labels: Maps each label that changes to its mirrored label.
    """

    places: NDArray[np.intp]
    labels: Mapping[Label, Label]


@dataclass(frozen=True, slots=True, kw_only=True)
class Abilities:
    """Capabilities of a learner beyond learning and predicting.

    Attributes:
        images: The learner stores images (`nodes`), which can be relabelled and deleted.
        pinning: An image can be pinned, so that it is not merged.
        novelty: `Evidence.novelty` measures how far a view is from all learned views.
        contexts: The prediction can depend on the current move: `learn_in`, `explain_in`.
        angles: The learner can learn an angle with the label: `begin_angles`.
        mirrors: The learner can also learn each example mirrored: `reflect`.
    """

    images: bool = False
    pinning: bool = False
    novelty: bool = False
    contexts: bool = False
    angles: bool = False
    mirrors: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Node:
    """One learned image. Its `id` survives merges; `frames` counts the frames merged into it.

    `angle` is the mean angle of these frames, if angles were learned.
    """

    id: int
    image: Vector
    votes: Mapping[Label, int]
    frames: int
    is_pinned: bool = False
    angle: float | None = None


@dataclass(slots=True)
class State:
    """The complete state of a learner, as arrays and plain values, to be saved and compared."""

    kind: str
    params: dict[str, Any]
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    labels: list[Label] = field(default_factory=list)


@runtime_checkable
class Learner(Protocol):
    """Protocol of an online classifier, which learns and predicts the labels of single frames.

    If the learner has `contexts`, the same view can have different labels in different contexts.
    A context is a small number; the caller chooses its meaning.
    """

    abilities: Abilities = Abilities()
    """The learner's capabilities beyond learning and predicting."""
    sharpness: float = 1.0
    """The power to which shares of votes are raised to calibrate them; 1 leaves them unchanged."""
    mirror: Mirror | None = None
    """Set while left and right count as alike: each example's mirror image is then learned, too."""
    last_node_: int | None = None
    """Id of the image that the latest example was merged into; None if there is no such image."""

    @property
    def n_nodes_(self) -> int:
        """Number of stored images."""
        return 0

    @abstractmethod
    def learn_one(self, x: Vector, y: Label) -> None:
        """Add one labelled vector. Raises ValueError for invalid input, which changes nothing."""

    def learn_in(
        self, x: Vector, y: Label, contexts: Collection[int], angle: float | None = None
    ) -> None:
        """Add a labelled vector that counts only in these contexts. Pass an `angle` only after
        `begin_angles`."""
        self.learn_one(x, y)

    @abstractmethod
    def explain_one(self, x: Vector) -> Evidence:
        """Return the prediction with its evidence.

        Raises:
            NotFittedError: Before the first example.
            ValueError: If `x` differs in shape from the learned vectors, or is not finite.
        """

    def explain_in(self, x: Vector, context: int | None) -> Evidence:
        """Return the prediction in one context; with None, the prediction of `explain_one`."""
        return self.explain_one(x)

    def begin_like(self, earlier: Sequence[State]) -> int:
        """Start with what earlier models, taught in other places, have in common.

        Call this before the first example; a few examples outweigh this start. Return how many of
        the earlier models were used; 0 if the learner cannot use any.
        """
        return 0

    def begin_angles(self, of_labels: Mapping[Label, float]) -> None:
        """Learn an angle from -1 to 1 with each example from now on. Each frame that was
        learned before gets the angle of its label: `of_labels[label]`, or 0 if it is missing."""
        return

    def predict_one(self, x: Vector) -> Label:
        """Return the most likely label (on a tie, the oldest); errors as in `explain_one`."""
        return self.explain_one(x).label

    def predict_proba_one(self, x: Vector) -> dict[Label, float]:
        """Return the share of each known label; the shares sum to 1. Errors as in `explain_one`."""
        return dict(self.explain_one(x).probabilities)

    @abstractmethod
    def get_state(self) -> State:
        """Return a copy of the state. `set_state` with this copy restores all predictions.

        The copy must be exact, because saving and undo rely on it: if a restored learner and the
        original learn the same further examples, they remain equal, bit for bit.
        """

    @abstractmethod
    def set_state(self, state: State) -> None:
        """Restore `state`; raises ValueError if it is from another kind of learner."""

    def reset(self) -> None:
        """Forget the state of the last drive, such as the robot's location, before a new drive."""
        return

    def nodes(self) -> list[Node]:
        """Return the learned images, in a fixed order; empty if the learner stores no images."""
        return []

    def relabel_node(self, node_id: int, y: Label, angle: float = 0.0) -> None:
        """Make one image vote only for `y`, and steer by `angle`.

        Raises:
            LookupError: If there is no image with this id.
            ValueError: If the learner stores no images.
        """
        raise ValueError(f"a {type(self).__name__} stores no images to edit")

    def delete_node(self, node_id: int) -> None:
        """Forget one image. Errors as in `relabel_node`, and ValueError if the image is pinned."""
        raise ValueError(f"a {type(self).__name__} stores no images to edit")

    def pin_node(self, node_id: int, pinned: bool = True) -> None:
        """Keep one image from being merged or deleted; raises the errors of `relabel_node`."""
        raise ValueError(f"a {type(self).__name__} stores no images to edit")

    def reflect(self, mirror: Mirror, on: bool) -> None:
        """Also learn the mirror images of all past and future examples; if not `on`, forget them.

        Raises:
            ValueError: If the learner cannot mirror examples.
        """
        raise ValueError("This learner cannot be told that left and right are alike.")

    def outdate(self) -> None:
        """Give more weight to examples taught after this call than to all earlier examples.

        Raises:
            ValueError: If the learner cannot tell old from new examples.
        """
        raise ValueError("This learner cannot give new examples more weight. Begin a new model.")


class BaseLearner(Learner):
    """Base class for learners without `abilities`; subclasses implement the abstract methods."""

    n_nodes_ = 0
