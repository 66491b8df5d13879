from __future__ import annotations

import numpy as np
import pytest

from robot.learner.base import NotFittedError
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import RecursiveRidge
from robot.learner.votes import ENOUGH, LATER
from tests.kit.sizes import crossed
from tests.robot.learner import paper


@crossed(seed=range(4), max_nodes=[1, 2, 6])
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


def test_predicting_before_the_first_example_is_an_error():
    with pytest.raises(NotFittedError):
        BSOCClassifier(2).predict_one(np.zeros(3))


@pytest.mark.parametrize("power", [0.0, 0.25, 1.0])
def test_a_rare_label_weighs_more(power):
    """Nine examples of one label, one of another, and a view exactly between their images."""
    learner = BSOCClassifier(2, balance=power)
    for _ in range(9):
        learner.learn_one(np.array([0.0]), "forward")
    learner.learn_one(np.array([1.0]), "left")
    shares = learner.predict_proba_one(np.array([0.5]))
    assert shares["left"] / shares["forward"] == pytest.approx(9.0**power)


SIZE = 8


@pytest.mark.parametrize("integer", [False, True])
def test_a_repeatedly_taught_view_keeps_its_new_label(integer):
    """Of identical images, only one has votes."""
    rng = np.random.default_rng(0)
    for _ in range(150):
        learner = BSOCClassifier(16, integer=integer)
        views = rng.integers(0, 256, (int(rng.integers(2, 6)), 20)).astype(np.uint8)
        learner.begin_angles({})
        for i in rng.integers(0, len(views), int(rng.integers(8, 32))).tolist():
            learner.learn_in(views[i], str(i), (), i / 8)
        for label in learner.labels_:
            evidence = learner.explain_one(views[int(label)])
            assert evidence.label == label
            assert evidence.angle == pytest.approx(int(label) / 8, abs=0.05)


def test_images_without_votes_do_not_affect_the_prediction():
    """Of identical images one has all votes, and the others vote for no label."""
    rng = np.random.default_rng(0)
    learner, view = BSOCClassifier(1024), rng.random(20)
    for label in ("left", "forward", "left", "forward", "left", "forward"):
        learner.learn_one(rng.random(20), label)
    learner.learn_one(view, "right")
    for _ in range(LATER + 1):
        learner.learn_one(rng.random(20), "forward")
    for _ in range(2 * int(ENOUGH)):
        learner.learn_one(rng.random(20), "forward")
        learner.learn_one(view, "right")
        assert learner.predict_one(view) == "right"
    assert learner.get_state().arrays["contradicted"].max() <= 1.0, "the first time it was new"


@pytest.mark.parametrize(("label", "angle"), [("", 0.0), ("left", np.nan), ("left", -2.0)])
def test_an_image_gets_no_label_or_angle_that_could_not_be_learned(label, angle):
    learner = BSOCClassifier(4, linear=RecursiveRidge(SIZE))
    learner.learn_one(np.arange(SIZE), "forward")
    with pytest.raises(ValueError, match=r"label|angle"):
        learner.relabel_node(0, label, angle)
    assert learner.labels_ == ["forward"] and learner.predict_one(np.arange(SIZE)) == "forward"
