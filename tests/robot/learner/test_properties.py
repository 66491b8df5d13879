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
from robot.learner.published import PublishedBSOC
from robot.learner.ridge import ContextRidge, RecursiveRidge
from tests.kit.sizes import examples
from tests.kit.states import same_state

LABELS = ("forward", "left", "right")
KINDS = [
    "default",
    "linear",
    "integer",
    "integer-linear",
    "context",
    "published",
    "published-integer",
]

sizes = st.integers(1, 9)
lessons = st.lists(st.tuples(arrays(np.uint8, 6), st.sampled_from(LABELS)), min_size=1, max_size=60)


def make(kind, max_nodes):
    if kind.startswith("published"):
        return BSOCClassifier.published(max_nodes, integer=kind.endswith("integer"))
    if kind == "integer-linear":  # like on a brick, two of six values are not compared
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


def restored(learner, kind):
    other = make(kind, learner.cluster.max_nodes)
    other.set_state(learner.get_state())
    return other


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=examples(40), deadline=None)
@given(max_nodes=sizes, lessons=lessons, more=lessons)
def test_a_restored_copied_or_pickled_learner_continues_like_the_original(
    kind, max_nodes, lessons, more
):
    learner = make(kind, max_nodes)
    for x, y in lessons:
        learner.learn_one(x, y)
    others = [restored(learner, kind), copy.deepcopy(learner), pickle.loads(pickle.dumps(learner))]
    for other in others:
        assert same_state(learner.get_state(), other.get_state())
    for x, y in more:
        said = learner.explain_one(x)
        learner.learn_one(x, y)
        for other in others:
            assert other.explain_one(x) == said
            other.learn_one(x, y)
    for other in others:
        assert same_state(learner.get_state(), other.get_state())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "bad",
    [
        (np.array([1.0, 2.0, np.inf, 4.0, 5.0, 6.0]), "left", 0.0),
        (np.full(6, np.nan), "left", 0.0),
        (np.full(6, 1e15), "left", 0.0),
        (np.zeros(5, np.uint8), "left", 0.0),
        (np.zeros(1, np.uint8), "left", 0.0),
        (np.zeros(0, np.uint8), "left", 0.0),
        (np.zeros((2, 3), np.uint8), "left", 0.0),
        (np.array(["1"] * 6), "left", 0.0),
        (np.zeros(6, complex), "left", 0.0),
        (np.zeros(6, np.uint8), "", 0.0),
        (np.zeros(6, np.uint8), None, 0.0),
        (np.zeros(6, np.uint8), 3, 0.0),
        (np.zeros(6, np.uint8), "left", np.nan),
        (np.zeros(6, np.uint8), "left", 1.5),
        (np.zeros(6, np.uint8), "left", -np.inf),
    ],
)
def test_invalid_examples_are_refused_and_change_nothing(kind, bad):
    learner, (x, label, angle) = make(kind, 3), bad
    for is_fresh in (True, False):
        before = learner.get_state()
        if not (is_fresh and x.ndim == 1 and 0 < x.size < 6):  # the first one sets the length
            with pytest.raises(ValueError, match=r"vector|label|whole|angle"):
                learner.learn_in(x, label, (0,), angle)
        assert same_state(before, learner.get_state())
        for i in range(8):
            learner.learn_one(np.full(6, 20 * i, np.uint8), LABELS[i % 3])
        learner.begin_angles(dict.fromkeys(LABELS, 0.0))


@settings(max_examples=examples(60), deadline=None)
@given(max_nodes=sizes, xs=st.lists(arrays(np.uint8, 6), min_size=1, max_size=40))
def test_float_and_whole_numbers_see_the_same_distances(max_nodes, xs):
    exact, whole, paper = (
        BSOC(max_nodes),
        BSOC(max_nodes, images=IntegerImages(max_nodes)),
        PublishedBSOC(max_nodes),
    )
    for x in xs[:max_nodes]:  # before any merge, at which ties could lead to different results
        assert exact.train(x) == whole.train(x) == paper.train(x)
    for x in xs:
        np.testing.assert_allclose(exact.distances(x), paper.distances(x), atol=0.5)
        np.testing.assert_allclose(whole.distances(x), paper.distances(x), atol=0.5)


@settings(max_examples=examples(40), deadline=None)
@given(xs=st.lists(arrays(np.uint8, 6), min_size=1, max_size=40), pins=st.lists(st.integers(0, 4)))
def test_pinned_nodes_stay(xs, pins):
    learner = BSOC(5)
    for x in xs[:5]:
        learner.train(x)
    pinned = {}
    for pin in pins[:3]:
        if pin < learner.n_nodes_:
            learner.pin(pin)
            pinned[int(learner.ids_[pin])] = learner.nodes_[pin].copy()
    for x in xs[5:]:
        learner.train(x)
    alive = dict(zip(learner.ids_.tolist(), learner.nodes_, strict=True))
    assert all(np.array_equal(alive[name], image) for name, image in pinned.items())
