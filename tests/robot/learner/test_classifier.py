from __future__ import annotations

import numpy as np
import pytest

from robot.learner.base import Learner, NotFittedError
from robot.learner.classifier import BSOCClassifier
from tests.robot.learner import paper


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("max_nodes", [1, 2, 6])
def test_published_histograms_equal_the_pseudocode(max_nodes, seed):
    rng = np.random.default_rng(seed)
    ours, theirs = BSOCClassifier.published(max_nodes), paper.PaperBSOC(max_nodes, rounded=False)
    for x in rng.integers(0, 9, (80, 3)).astype(np.uint8):
        y = str(rng.choice(["forward", "left", "right"]))
        ours.learn_one(x, y)
        theirs.train([int(v) for v in x], y)
        for slot, row in enumerate(ours.histograms_):
            counted = {label: n for label, n in zip(ours.labels_, row.tolist(), strict=True) if n}
            assert counted == theirs.nodes[slot].histogram


def test_is_a_learner():
    assert isinstance(BSOCClassifier(2), Learner)


def test_raises_before_the_first_lesson():
    with pytest.raises(NotFittedError):
        BSOCClassifier(2).predict_one(np.zeros(3))


def test_edits_follow_a_node_through_merges():
    learner = BSOCClassifier(2)
    for value, label in [(0.0, "left"), (0.1, "left"), (9.0, "right"), (9.1, "right")]:
        learner.learn_one(np.array([value]), label)
    node = learner.explain_one(np.array([0.0])).node
    learner.relabel_node(node, "forward")
    assert learner.predict_one(np.array([0.0])) == "forward"
    learner.delete_node(node)
    assert learner.predict_one(np.array([0.0])) == "right"
    with pytest.raises(LookupError, match="no node"):
        learner.delete_node(node)


@pytest.mark.parametrize("power", [0.0, 0.25, 1.0])
def test_a_rare_label_weighs_more(power):
    """Nine of one label to one of another, and a view just between their images."""
    learner = BSOCClassifier(2, balance=power)
    for _ in range(9):
        learner.learn_one(np.array([0.0]), "forward")
    learner.learn_one(np.array([1.0]), "left")
    shares = learner.predict_proba_one(np.array([0.5]))
    assert shares["left"] / shares["forward"] == pytest.approx(9.0**power)
