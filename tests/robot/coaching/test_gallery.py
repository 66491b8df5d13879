from __future__ import annotations

import numpy as np
import pytest

from robot.coaching.gallery import images
from robot.learner.base import Evidence
from robot.policy.part import Seen, TaughtExample
from robot.policy.registry import make_policy
from robot.types import Action

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


def test_an_image_says_when_it_was_used_and_taught_last(policy):
    first, second, _ = (node.id for node in policy.learner.nodes())
    use(policy, first, 1)
    use(policy, first, 4)
    teach(policy, second, 2)
    use(policy, None, 9)
    shown = {image.node_id: image for image in images(policy)}
    assert (shown[first].last_used, shown[first].last_taught) == (4, 0)
    assert (shown[second].last_used, shown[second].last_taught) == (0, 2)
    assert [image.node_id for image in images(policy)] == [n.id for n in policy.learner.nodes()]


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
