from __future__ import annotations

import copy

import numpy as np
import pytest

from robot.learner.bsoc import BSOC
from robot.learner.integer_images import IntegerImages
from robot.learner.published import PublishedBSOC
from tests.robot.learner import paper


@pytest.mark.parametrize("cluster", [BSOC, PublishedBSOC])
@pytest.mark.parametrize("d", [2, 30])
@pytest.mark.parametrize("max_nodes", [1, 2, 5, 9])
def test_the_nodes_equal_those_of_the_pseudocode_without_rounding(cluster, max_nodes, d):
    rng = np.random.default_rng(max_nodes)
    ours, theirs = cluster(max_nodes), paper.PaperBSOC(max_nodes, rounded=False)
    for x in rng.normal(size=(240, d)).astype(np.float32):
        assert ours.train(x) == theirs.train(x.tolist())
        np.testing.assert_allclose(ours.nodes_, [node.image for node in theirs.nodes], atol=1e-4)
        assert ours.counts_.tolist() == [node.count for node in theirs.nodes]
        assert ours.ids_.tolist() == [node.name for node in theirs.nodes]


@pytest.mark.parametrize("cluster", [BSOC, PublishedBSOC])
def test_exact_ties_are_broken_like_in_the_pseudocode(cluster):
    points = [[0], [8], [16], [24], [4], [12], [0], [8], [32], [40], [32], [40], [16], [16]]
    for max_nodes in (1, 2, 3, 4, 5):
        ours, theirs = cluster(max_nodes), paper.PaperBSOC(max_nodes, rounded=False)
        for x in points:
            slots = ours.train(np.array(x, np.float32)), theirs.train([float(v) for v in x])
            if not all(n.count & (n.count - 1) == 0 for n in theirs.nodes):
                break  # a share of 1/3 is not exact in binary, so there are no ties from here on
            assert slots[0] == slots[1]
            assert ours.nodes_.tolist() == [node.image for node in theirs.nodes]


@pytest.mark.parametrize("is_published", [False, True])
def test_whole_numbers_of_large_pictures_are_compared_exactly(is_published):
    ours = BSOC(2, images=IntegerImages(2))
    learner = PublishedBSOC(2, integer=True) if is_published else ours
    for level in (0, 100):
        learner.train(np.full(160 * 120 * 3, level, np.uint8))
    white = np.full(160 * 120 * 3, 255, np.uint8)
    assert learner.lookup(white) == (1, pytest.approx(160 * 120 * 3 * 155**2))


def test_nodes_of_different_labels_are_merged_only_as_a_last_resort():
    learner = BSOC(2, group_cost=1000.0)
    for value, group in [(0.0, 0), (1.0, 1), (9.0, 1)]:
        learner.train(np.array([value]), group)
    assert sorted(learner.groups_.tolist()) == [0, 1]
    assert sorted(learner.nodes_.ravel().tolist()) == [0.0, 5.0]


@pytest.mark.parametrize("max_nodes", [1, 3, 8, 30])
def test_whole_numbers_give_the_same_nodes_within_rounding(max_nodes):
    rng = np.random.default_rng(4)
    scenes = rng.integers(0, 256, (6, 50))
    exact, whole = BSOC(max_nodes), BSOC(max_nodes, images=IntegerImages(max_nodes))
    for i in range(200):
        x = np.clip(scenes[i % 6] + rng.integers(-9, 10, 50), 0, 255).astype(np.uint8)
        assert exact.train(x) == whole.train(x)
    assert np.array_equal(exact.counts_, whole.counts_)
    assert np.abs(exact.nodes_ - whole.nodes_).max() < 0.01


def test_the_cached_minima_find_the_smallest_weight():
    rng = np.random.default_rng(5)
    learner = BSOC(20)
    for i, x in enumerate(rng.integers(0, 4, (300, 4)).astype(np.float32)):
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
    """Beyond float32 every merge would have the same cost, and a pinned node would be merged."""
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


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("d", "top"), [(1, 4), (3, 3), (12, 255)])
@pytest.mark.parametrize("max_nodes", [1, 2, 3, 5, 8])
def test_published_bytes_equal_the_pseudocode_ties_included(max_nodes, d, top, seed):
    """Few values and short vectors have many equal distances, so there are many ties to break."""
    rng = np.random.default_rng(seed)
    ours = PublishedBSOC(max_nodes, integer=True)
    theirs = paper.PaperBSOC(max_nodes, rounded=True)
    for x in rng.integers(0, top + 1, (60, d)).astype(np.uint8):
        assert ours.train(x) == theirs.train(x.tolist())
        assert ours.nodes_.tolist() == [node.image for node in theirs.nodes]
        assert ours.counts_.tolist() == [node.count for node in theirs.nodes]
        assert ours.ids_.tolist() == [node.name for node in theirs.nodes]
        assert ours.lookup(x) == theirs.lookup(x.tolist())


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
