from __future__ import annotations

import numpy as np
import pytest

from robot.learner.classifier import BSOCClassifier
from robot.policy.gallery import Gallery
from robot.policy.registry import make_policy


@pytest.fixture
def learner():
    learner = BSOCClassifier(3)
    for level in (0, 25, 50):
        learner.learn_one(np.full(1200, level, np.uint8), "forward")
    return learner


@pytest.fixture
def gallery(learner):
    return Gallery(learner, make_policy("published-3").features)


def test_an_image_says_when_it_was_used_and_taught_last(learner, gallery):
    first, second, _ = (node.id for node in learner.nodes())
    gallery.note_used(first, 1)
    gallery.note_used(first, 4)
    gallery.note_taught(second, 2)
    gallery.note_used(None, 9)
    shown = {image.node_id: image for image in gallery.images()}
    assert (shown[first].last_used, shown[first].last_taught) == (4, 0)
    assert (shown[second].last_used, shown[second].last_taught) == (0, 2)
    assert [image.index for image in gallery.images()] == [0, 1, 2]


def test_what_was_taught_is_restored_and_what_was_used_is_forgotten(learner, gallery):
    node = learner.nodes()[0].id
    gallery.note_used(node, 7)
    gallery.note_taught(node, 5)
    gallery.load(*gallery.save())
    image = gallery.images()[0]
    assert (image.last_used, image.last_taught) == (0, 5)


def test_nodes_that_are_gone_are_forgotten_in_the_end(learner, gallery):
    kept = learner.nodes()[0].id
    gallery.note_taught(kept, 1)
    for number in range(1000):
        gallery.note_taught(10_000 + number, number)
    assert len(gallery.save()[0]["last_taught"]) <= 4 * learner.n_nodes_ + 65
    assert gallery.save()[0]["last_taught"][str(kept)] == 1
