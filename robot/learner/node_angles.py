"""The angles that learned images stand for: of each, what its frames steered, and how unlike.

Kept as sums, so that images merge by adding up; how many frames there were, the histograms say.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from robot.learner.clusters import MOST_FRAMES, Merge
from robot.learner.part import Array, Stateful

Floats = NDArray[np.float64]


class NodeAngles(Stateful):
    """Sums of the angles, from -1 to 1, of each node's frames, and of their squares.

    Args:
        max_nodes: How many nodes there are at most.

    Attributes:
        sums: Shape (max_nodes, 2); None as long as no angle was learned.
    """

    fields = (
        Array(
            *("node_angles", np.float64, ("max_nodes", 2), -MOST_FRAMES, MOST_FRAMES, "sums"),
            may_miss=True,
        ),
    )

    def __init__(self, max_nodes: int) -> None:
        self.max_nodes = max_nodes
        self.sums: Floats | None = None

    def begin(self, histograms: NDArray[np.int64], of_labels: Floats) -> None:
        """Let each frame so far have the angle of its label."""
        self.sums = histograms.astype(np.float64) @ np.stack([of_labels, of_labels**2], axis=1)

    def add(self, node: int, angle: float) -> None:
        """Add a frame to a node."""
        if self.sums is not None:
            self.sums[node] += angle, angle * angle

    def merge(self, merge: Merge) -> None:
        """Let one node have the frames of two."""
        if self.sums is not None:
            self.sums[merge.kept] += self.sums[merge.removed]
            self.sums[merge.removed] = 0.0

    def turn(self, node: int, frames: int, angle: float) -> float:
        """Give all frames of a node one angle; return by how much that changes their sum."""
        if self.sums is None:
            return 0.0
        change = frames * angle - float(self.sums[node, 0])
        self.sums[node] = frames * angle, frames * angle * angle
        return change

    def delete(self, node: int, last: int) -> float:
        """Forget a node, whose place the last one takes; return the sum of its angles."""
        if self.sums is None:
            return 0.0
        gone = float(self.sums[node, 0])
        self.sums[node] = self.sums[last]
        self.sums[last] = 0.0
        return gone

    def mean(self, node: int, frames: int) -> float | None:
        """Return the mean angle of a node of so many frames; None if none was learned."""
        return None if self.sums is None else float(self.sums[node, 0]) / max(frames, 1)

    def near(
        self, voters: NDArray[np.intp], weights: Floats, frames: NDArray[np.int64]
    ) -> tuple[float, float]:
        """Return mean and standard deviation of the angle among some nodes of so many frames."""
        assert self.sums is not None
        shares = weights / (weights.sum() * np.maximum(frames[voters], 1))
        mean, square = (shares @ self.sums[voters]).tolist()
        return mean, math.sqrt(max(square - mean * mean, 0.0))

    def faults(self) -> Iterator[str]:
        if self.sums is not None and (self.sums[:, 1] < 0.0).any():
            yield "the squares of some angles are below zero"
