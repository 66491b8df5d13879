"""The protocol that every learner implements."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[Any]
"""A feature vector of shape (d,): float32 or uint8, finite, the same d on every call."""

Label = str
"""A class. Labels are plain strings; an enum whose members are strings will do."""


class NotFittedError(ValueError):
    """A prediction was requested from a learner that has learned nothing."""


def checked_vector(x: Vector, n_features: int | None = None) -> Vector:
    """Return `x` as an array, if it is a valid vector.

    Raises:
        ValueError: If `x` is not a non-empty, finite vector of numbers, or has not
            `n_features` values.
    """
    array = np.asarray(x)
    if array.ndim != 1 or array.size == 0:
        raise ValueError(
            f"a feature vector must be one-dimensional and not empty, not {array.shape}"
        )
    if array.dtype.kind not in "fiub":
        raise ValueError(f"a feature vector must hold numbers, not {array.dtype}")
    if n_features is not None and array.size != n_features:
        raise ValueError(f"the vector has {array.size} values; the learner expects {n_features}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError("the vector has values that are not finite")
    return array


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """A prediction together with what it rests on.

    `probabilities` sum to 1. `confidence` is a calibrated chance that `label` is right.
    `novelty` is 0 for a familiar view; 1 or more means: unlike all that was learned. It is always 0
    if the learner's abilities lack novelty.
    `node` is the id of the nearest learned image (None where the learner keeps none).
    As soon as angles were learned there are `angle`, about from -1 to 1, its standard deviation
    `spread`, and `size`: how large it is whichever way, where a view is left by either.
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
    """How a view and its label look in a mirror.

    Attributes:
        places: Of each value of a vector that a linear part uses, which value is in its place.
        labels: Of each label that is another one, which.
    """

    places: NDArray[np.intp]
    labels: Mapping[Label, Label]


@dataclass(frozen=True, slots=True, kw_only=True)
class Abilities:
    """Capabilities of a learner beyond learning and predicting. All can be undone: see `get_state`.

    Attributes:
        images: It keeps images that `nodes` lists and that can be relabelled and deleted.
        pinning: An image can be kept from being merged.
        novelty: `Evidence.novelty` shows how unlike all that was learned a view is.
        contexts: Its prediction can depend on the move under way: `learn_in`, `explain_in`.
        angles: It learns an angle beside the label: `begin_angles`.
        mirrors: It can learn what it is taught in the mirror, too: `reflect`.
    """

    images: bool = False
    pinning: bool = False
    novelty: bool = False
    contexts: bool = False
    angles: bool = False
    mirrors: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Node:
    """One learned image. `id` follows it through merges; `frames` is how many it sums up.

    `angle` is their mean angle, if angles were learned.
    """

    id: int
    image: Vector
    votes: Mapping[Label, int]
    frames: int
    is_pinned: bool = False
    angle: float | None = None


@dataclass(slots=True)
class State:
    """All that a learner has learned, as arrays and plain values, to be saved and compared."""

    kind: str
    params: dict[str, Any]
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    labels: list[Label] = field(default_factory=list)


@runtime_checkable
class Learner(Protocol):
    """Protocol of an online classifier: learns one frame at a time, and predicts its label.

    To one that has `contexts` the same view can mean one thing in one context, another in another.
    A context is a small number; what it stands for is its user's affair.
    """

    abilities: Abilities = Abilities()
    """Its capabilities beyond learning and predicting."""
    sharpness: float = 1.0
    """The power that turns shares of votes into calibrated chances; 1 for none."""
    mirror: Mirror | None = None
    """Where left and right are alike: each example is also learned as it is in this mirror."""
    last_node_: int | None = None
    """Id of the image that took in the latest example; None if there is none."""

    @property
    def n_nodes_(self) -> int:
        """How many images it keeps."""
        return 0

    @abstractmethod
    def learn_one(self, x: Vector, y: Label) -> None:
        """Add one labelled vector. Refuses bad input with ValueError and is then unchanged."""

    def learn_in(
        self, x: Vector, y: Label, contexts: Collection[int], angle: float | None = None
    ) -> None:
        """Add one that counts only in these contexts; with its angle after `begin_angles`."""
        self.learn_one(x, y)

    @abstractmethod
    def explain_one(self, x: Vector) -> Evidence:
        """Return the prediction with its evidence.

        Raises:
            NotFittedError: Before the first example.
            ValueError: If `x` is of another shape than those learned, or not finite.
        """

    def explain_in(self, x: Vector, context: int | None) -> Evidence:
        """Return the prediction in one context; None: in any, as `explain_one`."""
        return self.explain_one(x)

    def begin_angles(self, of_labels: Mapping[Label, float]) -> None:
        """Learn an angle from -1 to 1 with each example from now on; each frame so far had the
        angle of its label, or 0. Before, angles cost nothing."""
        return

    def predict_one(self, x: Vector) -> Label:
        """Return the most likely label, the first learned on a tie; raises as `explain_one`."""
        return self.explain_one(x).label

    def predict_proba_one(self, x: Vector) -> dict[Label, float]:
        """Return each known label's share; shares sum to 1; raises as `explain_one`."""
        return dict(self.explain_one(x).probabilities)

    @abstractmethod
    def get_state(self) -> State:
        """Return a copy of all that was learned; `set_state` of it changes no prediction.

        Saving and undo rely on it: further learning after `set_state` gives the same learner,
        bit for bit, as without it.
        """

    @abstractmethod
    def set_state(self, state: State) -> None:
        """Restore `state`. Raises ValueError if it is of another kind."""

    def reset(self) -> None:
        """Forget what belongs to one drive, such as the place, before a new drive."""
        return

    def nodes(self) -> list[Node]:
        """Return the learned images, in a fixed order; none without that ability."""
        return []

    def relabel_node(self, node_id: int, y: Label, angle: float = 0.0) -> None:
        """Let one image vote only for `y`, and steer by its angle.

        Raises:
            LookupError: If there is no image of this id.
            ValueError: If the learner keeps no images.
        """
        raise ValueError(f"a {type(self).__name__} keeps no images to edit")

    def delete_node(self, node_id: int) -> None:
        """Forget one image; raises as `relabel_node`, and ValueError if it is pinned."""
        raise ValueError(f"a {type(self).__name__} keeps no images to edit")

    def pin_node(self, node_id: int, pinned: bool = True) -> None:
        """Keep one image from being merged or deleted; raises as `relabel_node`."""
        raise ValueError(f"a {type(self).__name__} keeps no images to edit")

    def reflect(self, mirror: Mirror, on: bool) -> None:
        """Learn all that was taught, and is taught from now on, in a mirror, too; or no longer.

        Raises:
            ValueError: If the learner cannot.
        """
        raise ValueError("This learner cannot be told that left and right are alike.")

    def outdate(self) -> None:
        """Let what is taught from now on count more than what was taught before.

        Raises:
            ValueError: If the learner cannot.
        """
        raise ValueError("This learner cannot tell old from new. Begin an empty model instead.")


class BaseLearner(Learner):
    """A `Learner` without images and other abilities, to derive from: four methods are to write."""

    n_nodes_ = 0
