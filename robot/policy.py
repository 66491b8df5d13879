"""From a frame to a proposed action: features, learner, and what smooths its votes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import ConfigurationError
from robot.image import to_grey
from robot.learner.base import State, Vector
from robot.types import DEFAULT_MOVES, Action, Frame, Prediction


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedImage:
    """One reference image as a gallery shows it."""

    node_id: int
    index: int
    thumbnail: NDArray[np.uint8]
    votes: dict[Action, int]
    frames: int


class Policy:
    """The published learner on grey 40x30 pictures, plainly written."""

    def __init__(self, name: str, max_nodes: int, moves: Sequence[Action]) -> None:
        self.name = name
        self.max_nodes = max_nodes
        self.moves = tuple(moves)
        self._forget()

    def _forget(self) -> None:
        self.n_seen = 0
        self._nodes = np.zeros((0, 1200), np.float32)
        self._counts = np.zeros(0, np.int64)
        self._ids = np.zeros(0, np.int64)
        self._votes = np.zeros((0, len(Action)), np.int64)

    @property
    def n_nodes(self) -> int:
        """How many reference images there are."""
        return len(self._nodes)

    def extract(self, frame: Frame) -> Vector:
        """Return the grey picture at 40x30 as a vector, shape (1200,), float32."""
        grey = to_grey(frame)
        return (
            grey[:: grey.shape[0] // 30, :: grey.shape[1] // 40][:30, :40]
            .astype(np.float32)
            .ravel()
        )

    def propose(self, frame_id: int, x: Vector) -> Prediction:
        """Say what to do on this frame."""
        if not self.n_nodes:
            return Prediction(frame_id=frame_id, action=None, confidence=0.0, probabilities={})
        distances = ((self._nodes - x) ** 2).sum(1)
        nearest = int(distances.argmin())
        votes = self._votes[nearest]
        shares = {a: float(votes[i] / votes.sum()) for i, a in enumerate(Action) if a in self.moves}
        best = max(shares, key=lambda action: shares[action])
        return Prediction(
            frame_id=frame_id,
            action=best,
            confidence=shares[best],
            probabilities=shares,
            node=int(self._ids[nearest]),
            distance=float(distances[nearest]) / x.size,
        )

    def learn(self, x: Vector, label: Action) -> None:
        """Add one labelled frame."""
        self._nodes = np.vstack((self._nodes, x))
        self._counts = np.append(self._counts, 1)
        self._ids = np.append(self._ids, self.n_seen)
        self._votes = np.vstack((self._votes, np.zeros(len(Action), np.int64)))
        self.n_seen += 1
        if self.n_nodes > self.max_nodes:
            self._merge_closest()
        nearest = int(((self._nodes - x) ** 2).sum(1).argmin())
        self._votes[nearest, list(Action).index(label)] += 1

    def _merge_closest(self) -> None:
        gaps = ((self._nodes[:, None] - self._nodes[None]) ** 2).sum(2)
        weights = gaps * np.maximum(self._counts[:, None], self._counts[None])
        np.fill_diagonal(weights, np.inf)
        a, b = sorted(divmod(int(weights.argmin()), self.n_nodes))
        share = self._counts[b] / (self._counts[a] + self._counts[b])
        self._nodes[a] += (self._nodes[b] - self._nodes[a]) * share
        self._ids[a] = self._ids[a] if self._counts[a] >= self._counts[b] else self._ids[b]
        self._counts[a] += self._counts[b]
        self._votes[a] += self._votes[b]
        keep = np.arange(self.n_nodes) != b
        self._nodes, self._counts = self._nodes[keep], self._counts[keep]
        self._ids, self._votes = self._ids[keep], self._votes[keep]

    def settle(self) -> None:
        """A new drive begins; this learner remembers nothing of the one before."""

    def get_state(self) -> State:
        """Return a copy of all that was learned."""
        arrays: dict[str, NDArray[Any]] = {
            "nodes": self._nodes.copy(),
            "counts": self._counts.copy(),
            "ids": self._ids.copy(),
            "votes": self._votes.copy(),
        }
        return State(kind=self.name, params={"n_seen": self.n_seen}, arrays=arrays)

    def set_state(self, state: State) -> None:
        """Become the policy that gave `state`."""
        self.n_seen = state.params["n_seen"]
        self._nodes, self._counts, self._ids, self._votes = (
            state.arrays[name].copy() for name in ("nodes", "counts", "ids", "votes")
        )

    def gallery(self) -> list[LearnedImage]:
        """List the reference images."""
        return [
            LearnedImage(
                node_id=int(self._ids[i]),
                index=i,
                thumbnail=self._nodes[i].round().astype(np.uint8).reshape(30, 40),
                votes={a: int(v) for a, v in zip(Action, self._votes[i], strict=True) if v},
                frames=int(self._counts[i]),
            )
            for i in range(self.n_nodes)
        ]

    def relabel_node(self, node_id: int, label: Action) -> None:
        """Give all votes of an image to `label`."""
        row = self._votes[self._find(node_id)]
        total = row.sum()
        row[:] = 0
        row[list(Action).index(label)] = total

    def delete_node(self, node_id: int) -> None:
        """Forget one image."""
        keep = np.arange(self.n_nodes) != self._find(node_id)
        self._nodes, self._counts = self._nodes[keep], self._counts[keep]
        self._ids, self._votes = self._ids[keep], self._votes[keep]

    def pin_node(self, node_id: int, pinned: bool) -> None:
        """Protect an image from merging."""
        self._find(node_id)

    def _find(self, node_id: int) -> int:
        found = np.flatnonzero(self._ids == node_id)
        if not len(found):
            raise LookupError(f"there is no learned image {node_id}")
        return int(found[0])


def make_policy(
    name: str = "default-32", moves: Sequence[Action] = DEFAULT_MOVES, *, integer: bool = False
) -> Policy:
    """Build a policy from its name, KIND-NUMBER."""
    kind, _, number = name.rpartition("-")
    if kind not in ("default", "published") or not number.isdigit():
        raise ConfigurationError(f"no learner is called {name!r}; try default-32")
    return Policy(name, int(number), moves)
