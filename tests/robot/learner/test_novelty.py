from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.learner.bsoc import BSOC
from robot.learner.votes import HELD_OUT, Novelty, percentile


def filled(lengths, **options):
    novelty = Novelty(**options)
    for length in lengths:
        novelty.learn(length**2)
    return novelty


def test_the_median_is_0_and_about_one_in_fifty_is_1_whatever_the_scale():
    lengths = np.random.default_rng(0).gamma(3.0, 1.0, 600)
    for scale in (0.01, 1.0, 1000.0):
        novelty = filled(scale * lengths)
        scores = np.array([novelty.score((scale * length) ** 2) for length in lengths])
        assert np.median(scores) == pytest.approx(0.0, abs=0.02)
        assert (scores >= 1.0).mean() == pytest.approx(0.018, abs=0.008)
        assert novelty.score((10 * scale * lengths.max()) ** 2) > 3


def test_a_wider_margin_moves_the_border_by_a_share_of_the_median():
    lengths = [1.0 + i % 600 / 599 for i in range(630)]
    usual, wide = filled(lengths), filled(lengths, margin=0.55)
    border = 1.98 + 0.05 * 1.5
    assert usual.score(border**2) == pytest.approx(1.0, abs=1e-6)
    assert wide.score((border + 0.5 * 1.5) ** 2) == pytest.approx(1.0, abs=1e-6)


def test_a_learner_that_has_seen_little_calls_nothing_novel():
    assert filled([1.0, 2.0, 3.0]).score(1e6) == 0.0


def test_its_scale_follows_the_last_examples_alone():
    novelty = filled([1.0 + 0.01 * (i % 10) for i in range(600)])
    assert novelty.score(9.0) > 1
    for i in range(600):
        novelty.learn((5.0 + 0.1 * (i % 10)) ** 2)
    assert novelty.score(9.0) == 0.0


@pytest.mark.parametrize("repeats", [1, 3])
def test_neighbouring_frames_do_not_count_as_familiar(repeats):
    """A slow pan: each frame is near the previous one, and far from all earlier frames."""
    cluster = BSOC(64)
    held, plain = [], []
    for i in range(200):
        x = np.zeros(400, np.float32)
        x[2 * i // repeats : 2 * i // repeats + 40] = 1.0
        if cluster.n_nodes_ > 1:
            plain.append(cluster.lookup(x)[1])
        cluster.train(x)
        if i > 2 * HELD_OUT and cluster.last_distance_ is not None:
            held.append(cluster.last_distance_)
    assert min(held) > 2 * np.median(plain)


@given(st.lists(st.floats(0.0, 1e6), min_size=2, max_size=700), st.sampled_from([50, 98]))
def test_percentiles_equal_those_of_numpy(values, share):
    assert percentile(sorted(values), share) == float(np.percentile(values, share))
