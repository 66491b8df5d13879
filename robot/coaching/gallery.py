"""Describes the learned images for the page's gallery: when each image was last used, and in which
cells of the picture a view resembles the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Node, Vector
from robot.policy.policy import Policy
from robot.types import Action

_COMPARED = 128
"""Maximum number of learned images that are compared with a view. If a learner has more images, the
view is compared with every n-th of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedImage:
    """One node, in the form that the gallery shows.

    A node keeps its `node_id` when it is merged. `last_used` is the number of the latest proposal
    that matched the node, and `last_taught` that of the latest example, or 0 if there is none.
    `angle` is the mean steering of the node's frames, if the pilot steered proportionally.
    """

    node_id: int
    thumbnail: NDArray[np.uint8]
    votes: dict[Action, int]
    frames: int
    last_used: int
    last_taught: int
    is_pinned: bool = False
    angle: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """Compares the current view with the learned image that decided the proposal.

    Attributes:
        image: The image.
        present: The view that the learner sees, shape (30, 40).
        alike: How strongly each cell of the picture suggests this image, from 0 to 1, shape (6, 8);
            0 everywhere if there is only one image.
    """

    image: LearnedImage
    present: NDArray[np.uint8]
    alike: NDArray[np.float64]


def images(policy: Policy) -> list[LearnedImage]:
    """Return all learned images, in the order of the nodes; empty if the learner stores no
    images."""
    return [_shown(policy, node) for node in policy.learner.nodes()]


def _shown(policy: Policy, node: Node) -> LearnedImage:
    return LearnedImage(
        node_id=node.id,
        thumbnail=policy.features.thumbnail(node.image),
        votes={Action(label): count for label, count in node.votes.items()},
        frames=node.frames,
        last_used=policy.recognition.used.get(node.id, 0),
        last_taught=policy.recognition.taught.get(node.id, 0),
        is_pinned=node.is_pinned,
        angle=node.angle,
    )


def explain(policy: Policy, x: Vector, node_id: int | None) -> Explanation | None:
    """Explain why a view matched an image; return None if the image no longer exists.

    A squared distance is a sum over the cells of the picture. A cell counts as similar if its
    distance from this image is smaller than its mean distance from the learned images. A cell that
    is similar in all images, such as an empty floor, explains nothing.
    """
    nodes, features = policy.learner.nodes(), policy.features
    decides = next((node for node in nodes if node.id == node_id), None)
    if decides is None:
        return None
    view = np.asarray(x, np.float64)
    some = nodes[:: -(-len(nodes) // _COMPARED)]
    others = [features.cells(view - np.asarray(node.image, np.float64)) for node in some]
    usual = np.mean(others, axis=0)
    here = features.cells(view - np.asarray(decides.image, np.float64))
    # A cell in which the view differs little from all images hardly influenced the decision.
    weight = np.maximum(usual, usual.mean())
    alike = np.zeros_like(here)
    np.divide(usual - here, weight, out=alike, where=weight > 0.0)
    return Explanation(
        image=_shown(policy, decides),
        present=features.thumbnail(x),
        alike=alike.clip(0.0, 1.0),
    )
