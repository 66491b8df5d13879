from __future__ import annotations

import numpy as np
import pytest

from robot.learner.base import Evidence
from robot.learner.classifier import BSOCClassifier
from robot.policy.gallery import Gallery
from robot.policy.part import Lesson, Seen
from robot.policy.recognition import LastMet
from robot.policy.registry import make_policy
from robot.types import Action


@pytest.fixture
def learner():
    learner = BSOCClassifier(3)
    for level in (0, 25, 50):
        learner.learn_one(np.full(1200, level, np.uint8), "forward")
    return learner


@pytest.fixture
def met(learner):
    return LastMet(learner)


@pytest.fixture
def gallery(learner, met):
    return Gallery(learner, make_policy("published-3").features, met)


def use(met, node, number):
    evidence = Evidence(label="forward", probabilities={}, confidence=1.0, node=node)
    nothing = np.zeros(1200, np.uint8)
    met.on_frame(Seen(number=number, x=nothing, picture=nothing, evidence=evidence))


def teach(met, node, number):
    met._learner.last_node_ = node
    nothing = np.zeros(1200, np.uint8)
    met.on_example(Lesson(number=number, x=nothing, picture=nothing, label=Action.FORWARD))


def test_an_image_says_when_it_was_used_and_taught_last(learner, gallery, met):
    first, second, _ = (node.id for node in learner.nodes())
    use(met, first, 1)
    use(met, first, 4)
    teach(met, second, 2)
    use(met, None, 9)
    shown = {image.node_id: image for image in gallery.images()}
    assert (shown[first].last_used, shown[first].last_taught) == (4, 0)
    assert (shown[second].last_used, shown[second].last_taught) == (0, 2)
    assert [image.node_id for image in gallery.images()] == [node.id for node in learner.nodes()]


def test_what_was_taught_is_restored_and_what_was_used_is_forgotten(learner, gallery, met):
    node = learner.nodes()[0].id
    use(met, node, 7)
    teach(met, node, 5)
    met.load(*met.save())
    image = gallery.images()[0]
    assert (image.last_used, image.last_taught) == (0, 5)


def test_nodes_that_are_gone_are_forgotten_in_the_end(learner, met):
    kept = learner.nodes()[0].id
    teach(met, kept, 1)
    for number in range(1000):
        teach(met, 10_000 + number, number)
    assert len(met.save()[0]["last_taught"]) <= 4 * learner.n_nodes_ + 65
    assert met.save()[0]["last_taught"][str(kept)] == 1
