"""The gallery: what it says of each image, and the parts by which an image decides."""

from __future__ import annotations

import numpy as np
import pytest

from robot.coaching.gallery import explain, images
from robot.learner.base import Evidence
from robot.policy.features import CELL_COLUMNS, CELL_ROWS
from robot.policy.part import Seen, TaughtExample
from robot.policy.registry import make_policy
from robot.types import Action
from tests.kit.frames import frame_of
from tests.kit.sizes import crossed

NOTHING = np.zeros(1200, np.uint8)


@pytest.fixture
def policy():
    policy = make_policy("published-3")
    for level in (0, 25, 50):
        policy.learner.learn_one(np.full(1200, level, np.uint8), "forward")
    return policy


def use(policy, node, number):
    says = Evidence(label="forward", probabilities={}, confidence=1.0, node=node)
    policy.learner.explain_one = lambda x: says
    policy.recognition.on_frame(Seen(number=number, x=NOTHING, picture=NOTHING))


def teach(policy, node, number):
    policy.learner.last_node_ = node
    policy.learner.learn_one = lambda x, y: None
    lesson = TaughtExample(number=number, x=NOTHING, picture=NOTHING, label=Action.FORWARD)
    policy.recognition.on_example(lesson)


def test_what_was_taught_is_restored_and_what_was_used_is_forgotten(policy):
    node = policy.learner.nodes()[0].id
    use(policy, node, 7)
    teach(policy, node, 5)
    policy.recognition.load(*policy.recognition.save())
    image = images(policy)[0]
    assert (image.last_used, image.last_taught) == (0, 5)


def test_nodes_that_are_gone_are_forgotten_in_the_end(policy):
    kept = policy.learner.nodes()[0].id
    teach(policy, kept, 1)
    for number in range(1000):
        teach(policy, 10_000 + number, number)
    taught = policy.recognition.save()[0]["last_taught"]
    assert len(taught) <= 4 * policy.n_nodes + 65
    assert taught[str(kept)] == 1


NAMES = ("default-16", "published-16")
"""Learners on gradients, and on grey pixels only."""


@crossed(name=NAMES, seed=range(5))
def test_the_distances_of_the_parts_add_up_to_the_learners_distance(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    policy = make_policy(name)
    for label in (Action.FORWARD, Action.LEFT) * 3:
        policy.learn(policy.extract(frame_of(rng.integers(0, 256, (120, 160)))), label)
    x = policy.extract(frame_of(rng.integers(0, 256, (120, 160))))
    evidence = policy.learner.explain_one(x)
    node = next(node for node in policy.learner.nodes() if node.id == evidence.node)
    cells = policy.features.cells(np.asarray(x, float) - np.asarray(node.image, float))
    assert cells.shape == (CELL_ROWS, CELL_COLUMNS)
    assert cells.sum() == pytest.approx(evidence.distance, rel=1e-3)


@crossed(name=NAMES, seed=range(8))
def test_only_the_parts_that_the_deciding_image_alone_shares_are_marked(
    name: str, seed: int
) -> None:
    """Views of one ground; each image has a different pattern in one part."""
    rng = np.random.default_rng(seed)
    ground = rng.integers(90, 110, (120, 160))
    rows = rng.permutation(CELL_ROWS - 2)[:3] + 1
    columns = rng.permutation(CELL_COLUMNS - 2)[:3] + 1

    def view(which: int) -> np.ndarray:
        picture = ground + rng.integers(-2, 3, ground.shape)
        r, c = 20 * rows[which], 20 * columns[which]
        stripes = np.arange(20) // 2 % 2 * 200
        picture[r : r + 20, c : c + 20] = stripes[None, :] if which % 2 else stripes[:, None]
        return picture.clip(0, 255)

    policy = make_policy(name)
    for label, which in ((Action.FORWARD, 0), (Action.LEFT, 1), (Action.RIGHT, 2)):
        policy.learn(policy.extract(frame_of(view(which))), label)
    for which in range(3):
        x = policy.extract(frame_of(view(which)))
        proposal = policy.propose(1, x)
        why = explain(policy, x, proposal.node)
        assert why is not None and why.alike.shape == (CELL_ROWS, CELL_COLUMNS)
        assert why.alike.min() >= 0.0 and why.alike.max() <= 1.0
        assert why.alike[rows[which], columns[which]] > 0.6, "its own pattern"
        assert why.image.votes[(Action.FORWARD, Action.LEFT, Action.RIGHT)[which]] == 1
        np.testing.assert_array_equal(why.present, policy.features.thumbnail(x))
        # A part of bare ground is alike in all images, so it explains nothing.
        far = [
            (r, c)
            for r in range(CELL_ROWS)
            for c in range(CELL_COLUMNS)
            if all(abs(r - a) > 1 or abs(c - b) > 1 for a, b in zip(rows, columns, strict=True))
        ]
        bare = np.median([why.alike[part] for part in far])
        assert bare < 0.5 < why.alike[rows[which], columns[which]]


def test_without_an_image_there_is_nothing_to_show() -> None:
    rng = np.random.default_rng(3)
    policy = make_policy("default-16")
    x = policy.extract(frame_of(rng.integers(0, 256, (120, 160))))
    assert explain(policy, x, None) is None
    policy.learn(x, Action.LEFT)
    node = policy.propose(1, x).node
    assert node is not None and explain(policy, x, node + 99) is None, "merged meanwhile"
    why = explain(policy, x, node)
    assert why is not None and not why.alike.any(), "one image alone is like no other"
