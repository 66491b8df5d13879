"""Every kind of learner has these properties, whatever it is taught."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robot.bodies.ev3.integer_ridge import IntegerRidge
from robot.learner.bsoc import BSOC
from robot.learner.classifier import GROUP_COST, BSOCClassifier
from robot.learner.integer_images import IntegerImages
from robot.learner.ridge import ContextRidge, RecursiveRidge
from tests.kit.sizes import examples
from tests.kit.states import same_state

LABELS = ("forward", "left", "right")
OURS = ["default", "linear", "integer", "integer-linear", "context"]
KINDS = [*OURS, "published", "published-integer"]

sizes = st.integers(1, 9)
lessons = st.lists(st.tuples(arrays(np.uint8, 6), st.sampled_from(LABELS)), min_size=1, max_size=60)


def make(kind, max_nodes):
    if kind.startswith("published"):
        return BSOCClassifier.published(max_nodes, integer=kind.endswith("integer"))
    if kind == "integer-linear":  # as on a brick, two of six values are not compared
        images = IntegerImages(max_nodes, 4)
        cluster = BSOC(max_nodes, group_cost=GROUP_COST, images=images)
        return BSOCClassifier(max_nodes, linear=IntegerRidge(3), cluster=cluster)
    if kind == "context":
        return BSOCClassifier(max_nodes, linear=ContextRidge(4))
    linear = RecursiveRidge(4) if kind == "linear" else None
    return BSOCClassifier(max_nodes, linear=linear, integer=kind == "integer")


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=examples(40), deadline=None)
@given(max_nodes=sizes, lessons=lessons)
def test_nodes_counts_and_histograms_add_up(kind, max_nodes, lessons):
    learner = make(kind, max_nodes)
    for n, (x, y) in enumerate(lessons, 1):
        learner.learn_one(x, y)
        assert (
            learner.cluster.n_nodes_ == min(n, max_nodes) == len(set(learner.cluster.ids_.tolist()))
        )
        assert learner.cluster.counts_.sum() == learner.n_seen_ == n
        assert learner.histograms_.sum() == n
        assert learner.explain_one(x).confidence <= 1.0 + 1e-9
    counted = dict(zip(learner.labels_, learner.histograms_.sum(axis=0).tolist(), strict=True))
    assert counted == {y: [label for _, label in lessons].count(y) for y in learner.labels_}
    assert sum(learner.predict_proba_one(lessons[0][0]).values()) == pytest.approx(1.0)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=examples(40), deadline=None)
@given(max_nodes=sizes, lessons=lessons, more=lessons)
def test_a_restored_copied_or_pickled_learner_continues_like_the_original(
    kind, max_nodes, lessons, more
):
    learner = make(kind, max_nodes)
    for x, y in lessons:
        learner.learn_one(x, y)
    learner.begin_angles(dict.fromkeys(LABELS, 0.5))
    if kind in OURS:
        learner.outdate()
    restored = make(kind, max_nodes)
    restored.set_state(learner.get_state())
    others = [restored, copy.deepcopy(learner), pickle.loads(pickle.dumps(learner))]
    for other in others:
        assert same_state(learner.get_state(), other.get_state())
    for x, y in more:
        said = learner.explain_one(x)
        learner.learn_in(x, y, (0,), 0.25)
        for other in others:
            assert other.explain_one(x) == said
            other.learn_in(x, y, (0,), 0.25)
    for other in others:
        assert same_state(learner.get_state(), other.get_state())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("x", "label", "angle"),
    [
        (np.array([1.0, 2.0, np.inf, 4.0, 5.0, 6.0]), "left", 0.0),
        (np.full(6, np.nan), "left", 0.0),
        (np.full(6, 1e15), "left", 0.0),
        *((np.zeros(size, np.uint8), "left", 0.0) for size in (5, 1, 0, (2, 3))),
        (np.array(["1"] * 6), "left", 0.0),
        (np.zeros(6, complex), "left", 0.0),
        *((np.zeros(6, np.uint8), label, 0.0) for label in ("", None, 3)),
        *((np.zeros(6, np.uint8), "left", angle) for angle in (np.nan, 1.5, -np.inf)),
    ],
)
def test_invalid_examples_are_refused_and_change_nothing(kind, x, label, angle):
    learner = make(kind, 3)
    for is_fresh in (True, False):
        before = learner.get_state()
        if not (is_fresh and x.ndim == 1 and 0 < x.size < 6):  # the first vector sets the length
            with pytest.raises(ValueError, match=r"vector|label|whole|angle"):
                learner.learn_in(x, label, (0,), angle)
        assert same_state(before, learner.get_state())
        for i in range(8):
            learner.learn_one(np.full(6, 20 * i, np.uint8), LABELS[i % 3])
        learner.begin_angles(dict.fromkeys(LABELS, 0.0))
