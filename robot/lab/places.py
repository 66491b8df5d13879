"""One classifier for each place, and an index of its views that recognises the place.

Source: the paper's first item of future work.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from robot.lab.place_index import BinaryFeatures, PlaceIndex
from robot.learner.base import (
    Abilities,
    Evidence,
    Label,
    Node,
    NotFittedError,
    State,
    Vector,
    checked_vector,
)
from robot.learner.classifier import BSOCClassifier
from robot.learner.context_ridge import N_CONTEXTS
from robot.learner.part import Array, Stateful, Value, taken
from robot.learner.values import count, many, name, optional
from robot.policy.design import DEFAULT
from robot.policy.features import THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, GradientFeatures
from robot.policy.policy import Policy
from robot.types import Action

NEW_PLACE = 0.235
"""Mean share of bits that differ from every view of a place, from which it is not the place.
Views of one place differ by 0.03 to 0.16 from the nearest, of two places by 0.27 and more."""
_SMOOTHING = 0.9
N_LABELS = 64
_NEAR = 0.06
_SEARCH = 10


def make_multi_place(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return one default learner a place; a `Maker`."""
    learner = MultiPlace(
        lambda: DEFAULT.make_learner(number, integer),
        BinaryFeatures(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH),
    )
    return Policy(name, number, learner, GradientFeatures(), moves=moves)


class _Tracker:
    """How well the latest frames fit each place, smoothed: a robot does not jump between places."""

    def __init__(self) -> None:
        self.levels: list[float] = []

    def update(self, differences: list[float]) -> int:
        """Add one frame and return the place that fits best."""
        old = self.levels + differences[len(self.levels) :]
        self.levels = [
            _SMOOTHING * level + (1.0 - _SMOOTHING) * new
            for level, new in zip(old, differences, strict=True)
        ]
        return int(np.argmin(self.levels))


class MultiPlace(Stateful):
    """A learner with one classifier for each place that it meets, up to `max_places`.

    Args:
        make: Makes the classifier for a new place.
        features: Binary features of the grey picture at the end of each vector.
        max_places: Beyond this number a new place shares the classifier of the one most like it.
    """

    kind = "multi-place"
    fields = (
        Value("n_seen", count(), "n_seen_"),
        Value("size", optional(count())),
        Value("place", optional(count())),
        Value("pending", many(name, _SEARCH), "_waiting_labels"),
        Array(
            "pending",
            (np.uint8, np.float32),
            ("n_waiting", "_size"),
            may_miss=True,
            attribute="_waiting",
        ),
    )

    def __init__(
        self,
        make: Callable[[], BSOCClassifier],
        features: BinaryFeatures,
        max_places: int = 16,
    ) -> None:
        self.max_places = max_places
        self.networks_: list[BSOCClassifier] = []
        self.n_seen_ = 0
        self.last_node_: int | None = None
        self._make = make
        self._features = features
        self._indices: list[PlaceIndex] = []
        self._driving = _Tracker()
        self._size: int | None = None
        self._place: int | None = None
        self._waiting_labels: list[Label] = []
        self._waiting: list[Vector] = []

    @property
    def abilities(self) -> Abilities:
        """The abilities of its classifiers."""
        return (self.networks_[0] if self.networks_ else self._make()).abilities

    @property
    def sharpness(self) -> float:
        """The power that turns shares of votes into chances, as the classifiers have it."""
        return self.networks_[0].sharpness if self.networks_ else 1.0

    @property
    def n_nodes_(self) -> int:
        """Nodes of all classifiers together."""
        return sum(len(network.cluster) for network in self.networks_)

    def reset(self) -> None:
        """Forget where the robot was: a new drive begins, perhaps elsewhere."""
        self._settle_pending()
        self._place = None
        self._driving = _Tracker()

    def learn_one(self, x: Vector, y: Label) -> None:
        """Teach the classifier of this view's place, or a new one if no place fits.

        A robot changes its place only between drives, when a person carries it; new views during a
        drive belong to the same place. So the place is determined after `reset`: the next
        `_SEARCH` examples wait until they show together which place fits, or that none does.

        Raises:
            ValueError: If `x` or `y` cannot be learned; the learner is then unchanged.
        """
        self.learn_in(x, y, range(N_CONTEXTS))

    def learn_in(self, x: Vector, y: Label, contexts: Collection[int]) -> None:
        """Do as `learn_one`, in these contexts; an example that has to wait counts once in all."""
        bits = self._bits(x)
        if not isinstance(y, str) or not y:
            raise ValueError(f"a label must be a string, not {y!r}")
        if self.networks_:
            checked_vector(x, self._size)
        self.n_seen_ += 1
        self.last_node_ = None
        self._size = np.asarray(x).size
        if self._place is None and self.networks_:
            self._waiting.append(np.array(x))
            self._waiting_labels.append(y)
            if self.n_waiting >= _SEARCH:
                self._settle_pending()
            return
        self._teach(x, y, bits, contexts)

    def _settle_pending(self) -> None:
        """Decide to which place the waiting examples belong, and teach them."""
        if not self._waiting:
            return
        views = [self._bits(x) for x in self._waiting]
        levels = [
            float(np.mean([index.difference(bits) for bits in views])) for index in self._indices
        ]
        best = int(np.argmin(levels))
        is_new = levels[best] > NEW_PLACE and len(self.networks_) < self.max_places
        self._place = None if is_new else best
        for x, y, bits in zip(self._waiting, self._waiting_labels, views, strict=True):
            self._teach(x, y, bits, range(N_CONTEXTS))
        self._waiting, self._waiting_labels = [], []

    def _teach(
        self, x: Vector, y: Label, bits: NDArray[np.uint8], contexts: Collection[int]
    ) -> None:
        if self._place is None:
            self.networks_.append(self._make())
            self._indices.append(PlaceIndex())
            self._place = len(self.networks_) - 1
        network = self.networks_[self._place]
        network.learn_in(x, y, contexts)
        if network.last_node_ is not None:
            self.last_node_ = self._outer_id(self._place, network.last_node_)
        index = self._indices[self._place]
        if index.n_added == 0 or index.difference(bits) > _NEAR:
            index.add(bits)

    def predict_one(self, x: Vector) -> Label:
        """Return the label that this place's classifier predicts; raises NotFittedError."""
        return self.explain_one(x).label

    def predict_proba_one(self, x: Vector) -> dict[Label, float]:
        """Return the labels' shares in this place's classifier."""
        return dict(self.explain_one(x).probabilities)

    def explain_one(self, x: Vector) -> Evidence:
        """Recognise the place from this and the latest views, and predict with its classifier."""
        return self.explain_in(x, None)

    def explain_in(self, x: Vector, context: int | None) -> Evidence:
        """Do as `explain_one`, in one context."""
        if not self.networks_:
            raise NotFittedError("nothing was learned yet")
        bits = self._bits(x)
        place = self._driving.update([index.difference(bits) for index in self._indices])
        evidence = self.networks_[place].explain_in(x, context)
        if evidence.node is None:
            return evidence
        return dataclasses.replace(evidence, node=self._outer_id(place, evidence.node))

    def nodes(self) -> list[Node]:
        """Return the learned images of all places, place after place."""
        return [
            dataclasses.replace(node, id=self._outer_id(place, node.id))
            for place, network in enumerate(self.networks_)
            for node in network.nodes()
        ]

    def relabel_node(self, node_id: int, y: Label) -> None:
        """Let the image of this id vote for `y` alone; raises LookupError if there is none."""
        network, inner = self._inner_id(node_id)
        network.relabel_node(inner, y)

    def delete_node(self, node_id: int) -> None:
        """Forget the image of this id; raises LookupError if there is none."""
        network, inner = self._inner_id(node_id)
        network.delete_node(inner)

    def pin_node(self, node_id: int, pinned: bool = True) -> None:
        """Keep the image of this id as it is: never merged, never deleted."""
        network, inner = self._inner_id(node_id)
        network.pin_node(inner, pinned)

    def _outer_id(self, place: int, node_id: int) -> int:
        """Return an id that no image of another place has."""
        return node_id * self.max_places + place

    def _inner_id(self, node_id: int) -> tuple[BSOCClassifier, int]:
        inner, place = divmod(node_id, self.max_places)
        if place >= len(self.networks_):
            raise LookupError(f"there is no node {node_id}")
        return self.networks_[place], inner

    def _bits(self, x: Vector) -> NDArray[np.uint8]:
        size = self._features.height * self._features.width
        array = np.asarray(x)
        if array.ndim != 1 or array.size < size or not np.isfinite(array).all():
            raise ValueError(f"the vector has shape {array.shape}; a picture of {size} is missing")
        return self._features.extract(array[-size:])

    @property
    def n_waiting(self) -> int:
        """How many examples wait until their place is known."""
        return len(self._waiting_labels)

    def get_state(self) -> State:
        """Return a copy of all classifiers and indices."""
        params, arrays = self.save()
        params["places"] = []
        for i, (network, index) in enumerate(zip(self.networks_, self._indices, strict=True)):
            state, (values, views) = network.get_state(), index.save()
            own = {**state.arrays, **views}
            arrays.update({f"place{i}_{key}": array for key, array in own.items()})
            values |= {"kind": state.kind, "params": state.params, "labels": state.labels}
            params["places"].append(values)
        return State(self.kind, params, arrays)

    def set_state(self, state: State) -> None:
        """Restore `state`; raises ValueError if it is of another kind."""
        if state.kind != self.kind:
            raise ValueError(f"the model is a {state.kind}, not a {self.kind}")
        params, arrays = dict(state.params), dict(state.arrays)
        places = params.pop("places")
        if not isinstance(places, list) or len(places) > self.max_places:
            raise ValueError(f"it has no list of at most {self.max_places} places")
        self.networks_, self._indices = [], []
        for i, place in enumerate(places):
            network, index = self._make(), PlaceIndex()
            own = taken(arrays, f"place{i}_")
            values = {key: place[key] for key in place.keys() - {"kind", "params", "labels"}}
            index.load(values, {"views": own.pop("views")})
            labels = many(name, N_LABELS, 1)(place["labels"], {})
            network.set_state(State(place["kind"], place["params"], own, labels))
            self.networks_.append(network)
            self._indices.append(index)
        self.load(params, arrays)
        self._waiting = [] if self._waiting is None else list(self._waiting)
        self._driving = _Tracker()

    def faults(self) -> Iterator[str]:
        if self._place is not None and self._place >= len(self.networks_):
            yield "its place is unknown"
        if (self._size is None) != (not self.networks_):
            yield "its vectors have no length"
        if self._waiting and (not self.networks_ or self.n_waiting >= _SEARCH):
            yield "examples wait that need not"

    def check(self) -> None:
        """Raise ValueError, saying why, if it is not what it declares; nor any of its places."""
        super().check()
        for part in (*self.networks_, *self._indices):
            part.check()
