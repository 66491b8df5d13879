"""Why the policy would do what it would do: the image that a view is most like, and where. Pure.

A squared distance is a sum over the parts of the picture. A part counts as alike where it is nearer
to the deciding image than to the learned images on average: what all of them share, an empty floor,
explains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.policy.policy import Policy
from robot.types import Action

_COMPARED = 128
"""With more learned images than this, so many of them are compared, at even distances."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """The image that decides, beside the present view.

    Attributes:
        node_id: The image.
        present: The view as the learner sees it, shape (30, 40).
        image: The deciding image, shape (30, 40).
        alike: For each part how much more alike the two are than the view is to the learned images
            on average, from 0 to 1, shape (6, 8). All 0 if there is one image alone.
        votes: What the image was taught for, in frames.
        frames: How many frames it sums up.
    """

    node_id: int
    present: NDArray[np.uint8]
    image: NDArray[np.uint8]
    alike: NDArray[np.float64]
    votes: dict[Action, int]
    frames: int


def explain(policy: Policy, x: Vector, node_id: int | None) -> Explanation | None:
    """Return why a view with vector `x` was decided by the image `node_id`.

    None if the learner keeps no images, or this one is gone.
    """
    nodes = policy.learner.nodes()
    decisive = next((node for node in nodes if node.id == node_id), None)
    if decisive is None:
        return None
    features = policy.features
    view = np.asarray(x, np.float64)
    step = -(-len(nodes) // _COMPARED)
    others = [features.cells(view - np.asarray(node.image, np.float64)) for node in nodes[::step]]
    usual = np.mean(others, axis=0)
    here = features.cells(view - np.asarray(decisive.image, np.float64))
    # Where even the average difference is small there is little to be alike in.
    weight = np.maximum(usual, usual.mean())
    alike = np.zeros_like(here)
    np.divide(usual - here, weight, out=alike, where=weight > 0.0)
    return Explanation(
        node_id=decisive.id,
        present=features.thumbnail(x),
        image=features.thumbnail(decisive.image),
        alike=alike.clip(0.0, 1.0),
        votes={Action(label): count for label, count in decisive.votes.items()},
        frames=decisive.frames,
    )
