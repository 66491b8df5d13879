"""The learner's images and votes equal those of the paper's pseudocode, for any values."""

from __future__ import annotations

import copy
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pytest

from robot.learner import bsoc
from robot.learner.base import NotFittedError
from robot.learner.bsoc import BSOC
from robot.learner.classifier import BSOCClassifier
from robot.learner.integer_images import IntegerImages
from robot.learner.published import PublishedBSOC
from robot.learner.ridge import RecursiveRidge
from robot.learner.votes import ENOUGH, LATER
from tests.kit.sizes import crossed

# The paper's pseudocode as plain code, whose results the fast versions must equal ----------------


@dataclass
class Node:
    image: list
    count: int
    name: int
    histogram: Counter = field(default_factory=Counter)


def squared_distance(a, b):
    return sum((p - q) ** 2 for p, q in zip(a, b, strict=True))


class PaperBSOC:
    """Nodes are in slots without gaps; edges are sorted by weight, then by the slots of their
    ends."""

    def __init__(self, max_nodes, *, rounded=False):
        self.max_nodes, self.rounded = max_nodes, rounded
        self.nodes, self.n_seen = [], 0

    def lookup(self, x):
        distances = [squared_distance(node.image, x) for node in self.nodes]
        nearest = distances.index(min(distances))
        return nearest, distances[nearest]

    def train(self, x, y=None):
        self.nodes.append(Node(list(x), 1, self.n_seen))
        self.n_seen += 1
        if len(self.nodes) > self.max_nodes:
            edges = [
                (squared_distance(a.image, b.image) * max(a.count, b.count), i, j)
                for i, a in enumerate(self.nodes)
                for j, b in enumerate(self.nodes)
                if i < j
            ]
            _, i, j = min(edges)
            self.nodes[i] = self.merged(self.nodes[i], self.nodes[j])
            self.nodes[j] = self.nodes[-1]
            self.nodes.pop()
        slot = self.lookup(x)[0]
        self.nodes[slot].histogram[y] += 1
        return slot

    def merged(self, one, two):
        total = one.count + two.count
        image = [
            (one.count * p + two.count * q) / total
            for p, q in zip(one.image, two.image, strict=True)
        ]
        if self.rounded:
            image = [int(p + 0.5) for p in image]
        name = one.name if one.count >= two.count else two.name
        return Node(image, total, name, one.histogram + two.histogram)


@crossed(cluster=[BSOC, PublishedBSOC], d=[2, 30], max_nodes=[1, 2, 5, 9])
def test_the_nodes_equal_those_of_the_pseudocode_without_rounding(cluster, max_nodes, d):
    rng = np.random.default_rng(max_nodes)
    ours, theirs = cluster(max_nodes), PaperBSOC(max_nodes)
    for x in rng.normal(size=(240, d)).astype(np.float32):
        assert ours.train(x) == theirs.train(x.tolist())
        np.testing.assert_allclose(ours.nodes_, [node.image for node in theirs.nodes], atol=1e-4)
        assert ours.counts_.tolist() == [node.count for node in theirs.nodes]
        assert ours.ids_.tolist() == [node.name for node in theirs.nodes]


@crossed(cluster=[BSOC, PublishedBSOC], max_nodes=[1, 2, 3, 4, 5])
def test_exact_ties_are_broken_like_in_the_pseudocode(cluster, max_nodes):
    ours, theirs = cluster(max_nodes), PaperBSOC(max_nodes)
    for x in [0, 8, 16, 24, 4, 12, 0, 8, 32, 40, 32, 40, 16, 16]:
        slots = ours.train(np.array([x], np.float32)), theirs.train([float(x)])
        if not all(n.count & (n.count - 1) == 0 for n in theirs.nodes):
            break  # a share of 1/3 is not exact in binary, so later distances are never equal
        assert slots[0] == slots[1]
        assert ours.nodes_.tolist() == [node.image for node in theirs.nodes]


@crossed(seed=range(3), size=[(1, 4), (3, 3), (12, 255)], max_nodes=[1, 2, 3, 5, 8])
def test_published_bytes_equal_the_pseudocode_ties_included(max_nodes, size, seed):
    """Short vectors of few values have many equal distances, so many ties must be broken."""
    d, top = size
    rng = np.random.default_rng(seed)
    ours, theirs = PublishedBSOC(max_nodes, integer=True), PaperBSOC(max_nodes, rounded=True)
    for x in rng.integers(0, top + 1, (60, d)).astype(np.uint8):
        assert ours.train(x) == theirs.train(x.tolist())
        assert ours.nodes_.tolist() == [node.image for node in theirs.nodes]
        assert ours.counts_.tolist() == [node.count for node in theirs.nodes]
        assert ours.ids_.tolist() == [node.name for node in theirs.nodes]
        assert ours.lookup(x) == theirs.lookup(x.tolist())


@crossed(seed=range(4), max_nodes=[1, 2, 6])
def test_published_histograms_equal_the_pseudocode(max_nodes, seed):
    rng = np.random.default_rng(seed)
    ours, theirs = BSOCClassifier.published(max_nodes), PaperBSOC(max_nodes)
    for x in rng.integers(0, 9, (80, 3)).astype(np.uint8):
        y = str(rng.choice(["forward", "left", "right"]))
        ours.learn_one(x, y)
        theirs.train([int(v) for v in x], y)
        for slot, row in enumerate(ours.histograms_):
            counted = {label: n for label, n in zip(ours.labels_, row.tolist(), strict=True) if n}
            assert counted == theirs.nodes[slot].histogram


# Images -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("is_published", [False, True])
def test_whole_numbers_of_large_pictures_are_compared_exactly(is_published):
    ours = BSOC(2, images=IntegerImages(2))
    learner = PublishedBSOC(2, integer=True) if is_published else ours
    for level in (0, 100):
        learner.train(np.full(160 * 120 * 3, level, np.uint8))
    white = np.full(160 * 120 * 3, 255, np.uint8)
    assert learner.lookup(white) == (1, pytest.approx(160 * 120 * 3 * 155**2))


@pytest.mark.parametrize("max_nodes", [1, 3, 8, 30])
def test_whole_numbers_give_the_same_nodes_within_rounding(max_nodes):
    rng = np.random.default_rng(4)
    scenes = rng.integers(0, 256, (6, 50))
    exact, whole = BSOC(max_nodes), BSOC(max_nodes, images=IntegerImages(max_nodes))
    for i in range(200):
        x = np.clip(scenes[i % 6] + rng.integers(-9, 10, 50), 0, 255).astype(np.uint8)
        assert exact.train(x) == whole.train(x)
        np.testing.assert_allclose(whole.distances(x), exact.distances(x), atol=0.5, rtol=1e-3)
    assert np.array_equal(exact.counts_, whole.counts_)
    assert np.abs(exact.nodes_ - whole.nodes_).max() < 0.01


def test_nodes_of_different_labels_are_merged_only_as_a_last_resort():
    learner = BSOC(2, group_cost=1000.0)
    for value, group in [(0.0, 0), (1.0, 1), (9.0, 1)]:
        learner.train(np.array([value]), group)
    assert sorted(learner.groups_.tolist()) == [0, 1]
    assert sorted(learner.nodes_.ravel().tolist()) == [0.0, 5.0]


@pytest.mark.parametrize("cached_from", [1, 1000])
def test_the_smallest_weight_is_found_with_and_without_the_cache(monkeypatch, cached_from):
    monkeypatch.setattr(bsoc, "CACHED_FROM", cached_from)
    learner = BSOC(20)
    for i, x in enumerate(np.random.default_rng(5).integers(0, 4, (300, 4)).astype(np.float32)):
        learner.train(x)
        if i in (50, 200):
            learner.delete(3)
        if i == 100:
            learner = copy.deepcopy(learner)
        if i in (150, 250):
            learner.pin(5, i == 150)
        weights = learner._edges.weights
        one, two = divmod(int(weights.argmin()), len(weights))
        assert learner._edges.smallest() == (weights[one, two], one, two)


@pytest.mark.parametrize("refused", [[300.0, 1.0], [0.5, 1.0], [-1.0, 1.0]])
def test_a_refused_first_frame_fixes_no_length(refused):
    whole = BSOC(4, images=IntegerImages(4))
    with pytest.raises(ValueError, match="from 0 to 255"):
        whole.train(np.array(refused))
    assert whole.train(np.zeros(5, np.uint8)) == 0


@pytest.mark.parametrize("size", [1.0, 1e6, 1e11, 1e13, 1e16, 1e18])
def test_values_of_any_size_are_clustered_or_refused(size):
    """Beyond float32, all merges would have the same cost, and a pinned node would be merged."""
    learner, n_learned = BSOC(2, group_cost=1000.0), 0
    for i in range(60):
        x = size * min(i, 1) * np.random.default_rng(i).normal(size=3)
        try:
            learner.train(x, i % 2)
        except ValueError as error:
            assert "too large" in str(error)
            continue
        n_learned += 1
        if learner.n_nodes_ == 1:
            learner.pin(0)
            pinned = learner.nodes_[0].copy()
    assert learner.counts_.sum() == n_learned == learner.n_trained_
    assert n_learned == 60 or size > 1e11
    assert learner.counts_[0] == 1 and np.array_equal(learner.nodes_[0], pinned)


def test_a_pinned_node_is_not_deleted_and_one_node_stays_free_of_pins():
    learner = BSOC(2)
    for value in (0.0, 10.0):
        learner.train(np.array([value]))
    learner.pin(0)
    with pytest.raises(ValueError, match="unpin"):
        learner.delete(0)
    with pytest.raises(ValueError, match="at most 1 of 2"):
        learner.pin(1)
    assert learner.n_nodes_ == 2


# Votes ------------------------------------------------------------------------------------------


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
    assert learner.get_state().arrays["contradicted"].max() <= 1.0, "a new view contradicts nothing"


@pytest.mark.parametrize(("label", "angle"), [("", 0.0), ("left", np.nan), ("left", -2.0)])
def test_an_image_gets_no_label_or_angle_that_could_not_be_learned(label, angle):
    learner = BSOCClassifier(4, linear=RecursiveRidge(8))
    learner.learn_one(np.arange(8), "forward")
    with pytest.raises(ValueError, match=r"label|angle"):
        learner.relabel_node(0, label, angle)
    assert learner.labels_ == ["forward"] and learner.predict_one(np.arange(8)) == "forward"
