"""The gallery shows why a view matches an image, and when each image was last used."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from robot.coaching.gallery import explain
from robot.policy.features import CELL_COLUMNS, CELL_ROWS
from robot.policy.registry import make_policy
from robot.types import Action
from tests.kit.frames import frame_of
from tests.kit.sizes import crossed
from tests.robot.policy.passing import teach

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)
EITHER = crossed(name=("default-16", "published-16"), seed=range(6))
"""A learner on gradients, and a learner on only grey pixels."""


def test_images_that_are_gone_are_forgotten_in_the_end():
    policy = make_policy("published-3")
    policy.learner.learn_one(np.zeros(1200, np.uint8), "forward")
    policy.learner.learn_one = lambda x, y: None
    for number, node in enumerate([0, *range(10_000, 11_000)], 1):
        policy.learner.last_node_ = node
        teach(policy.recognition, Action.FORWARD, None, number=number)
    taught = policy.recognition.save()[0]["last_taught"]
    assert len(taught) <= 4 * policy.n_nodes + 65
    assert taught["0"] == 1


@EITHER
def test_the_distances_of_the_parts_add_up_to_the_learners_distance(name, seed):
    rng, policy = np.random.default_rng(seed), make_policy(name)

    def view():
        return policy.extract(frame_of(rng.integers(0, 256, (120, 160))))

    for label in MOVES[:2] * 3:
        policy.learn(view(), label)
    x = view()
    evidence = policy.learner.explain_one(x)
    node = next(node for node in policy.learner.nodes() if node.id == evidence.node)
    cells = policy.features.cells(np.asarray(x, float) - np.asarray(node.image, float))
    assert cells.shape == (CELL_ROWS, CELL_COLUMNS)
    assert cells.sum() == pytest.approx(evidence.distance, rel=1e-3)


@EITHER
def test_only_the_parts_that_the_deciding_image_alone_shares_are_marked(name, seed):
    """Views of the same ground, each with a different pattern in one part of the picture."""
    rng, policy = np.random.default_rng(seed), make_policy(name)
    ground = rng.integers(90, 110, (120, 160))
    rows = rng.permutation(CELL_ROWS - 2)[:3] + 1
    columns = rng.permutation(CELL_COLUMNS - 2)[:3] + 1

    def view(which):
        picture = ground + rng.integers(-2, 3, ground.shape)
        r, c = 20 * rows[which], 20 * columns[which]
        stripes = np.arange(20) // 2 % 2 * 200
        picture[r : r + 20, c : c + 20] = stripes[None, :] if which % 2 else stripes[:, None]
        return policy.extract(frame_of(picture.clip(0, 255)))

    for which, label in enumerate(MOVES):
        policy.learn(view(which), label)
    # A part that shows only bare ground is alike in all images, so it explains nothing.
    bare = [
        (r, c)
        for r, c in product(range(CELL_ROWS), range(CELL_COLUMNS))
        if all(abs(r - a) > 1 or abs(c - b) > 1 for a, b in zip(rows, columns, strict=True))
    ]
    for which, label in enumerate(MOVES):
        x = view(which)
        why = explain(policy, x, policy.propose(1, x).node)
        assert why.alike.shape == (CELL_ROWS, CELL_COLUMNS)
        assert why.alike.min() >= 0.0 and why.alike.max() <= 1.0
        assert why.alike[rows[which], columns[which]] > 0.6, "the view's own pattern matches"
        assert np.median([why.alike[part] for part in bare]) < 0.5
        assert why.image.votes[label] == 1
        np.testing.assert_array_equal(why.present, policy.features.thumbnail(x))


def test_without_an_image_there_is_nothing_to_show():
    policy = make_policy("default-16")
    x = policy.extract(frame_of(np.random.default_rng(3).integers(0, 256, (120, 160))))
    assert explain(policy, x, None) is None
    policy.learn(x, Action.LEFT)
    node = policy.propose(1, x).node
    assert explain(policy, x, node + 99) is None, "the image was merged meanwhile"
    assert not explain(policy, x, node).alike.any(), "a single image has no similar image"
