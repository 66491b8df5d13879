"""A block of frames teaches what the same frames teach one by one."""

from __future__ import annotations

import numpy as np
import pytest

from robot.learner.context_ridge import BLOCK, BlockRidge
from robot.learner.ridge import RecursiveRidge

SIZE, N_LABELS = 6, 3


def make():
    ridge = RecursiveRidge(SIZE, penalty=2.0, scale=1.0)
    for _ in range(N_LABELS):
        ridge.add_label()
    return ridge


@pytest.fixture
def frames():
    rng = np.random.default_rng(1)
    return rng.normal(size=(3 * BLOCK, SIZE)), np.eye(N_LABELS)[rng.integers(0, 3, 3 * BLOCK)]


def taught(frames, n, ridge=None):
    """Return a ridge that learns in blocks, and one that learns one by one."""
    block, single = BlockRidge(ridge or make()), make()
    for x, targets in zip(frames[0][:n], frames[1][:n], strict=True):
        block.learn_scaled(single.scaled(x), targets)
        single.learn(x, targets)
    return block, single


def assert_same(block, single, frames):
    for x in frames[0][-5:]:
        np.testing.assert_allclose(block.scores(x), single.scores(x), atol=1e-12)


@pytest.mark.parametrize("n", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK])
def test_every_frame_counts_at_once(frames, n):
    assert_same(*taught(frames, n), frames)


def test_what_it_knows_does_not_depend_on_being_asked(frames):
    silent, asked = taught(frames, 0)[0], taught(frames, 0)[0]
    for x, targets in zip(*frames, strict=True):
        for ridge in (silent, asked):
            ridge.learn_scaled(make().scaled(x), targets)
        asked.scores(x)
    for name, array in silent.save()[1].items():
        np.testing.assert_array_equal(array, asked.save()[1][name])


@pytest.mark.parametrize("n", [0, 5, BLOCK, BLOCK + 7])
def test_it_goes_on_bit_for_bit_from_what_was_saved(frames, n):
    before, _ = taught(frames, n)
    after = BlockRidge(make())
    after.load({}, before.save()[1])
    for x, targets in zip(frames[0][n:], frames[1][n:], strict=True):
        for ridge in (before, after):
            ridge.learn_scaled(make().scaled(x), targets)
    for name, array in before.save()[1].items():
        np.testing.assert_array_equal(array, after.save()[1][name])


def test_a_copy_of_a_ridge_begins_with_all_that_it_learned(frames):
    _, single = taught(frames, 13)
    copy = BlockRidge(make())
    copy.load({}, single.save()[1])
    assert_same(copy, single, frames)


def test_its_inverse_is_symmetric_to_the_last_bit(frames):
    ridge = make()
    taught(frames, 3 * BLOCK, ridge)
    np.testing.assert_array_equal(ridge._inverse, ridge._inverse.T)


@pytest.mark.parametrize("n", [3, BLOCK + 3])
def test_frames_can_be_taken_back_and_relabelled_while_others_wait(frames, n):
    block, single = taught(frames, n)
    x, targets = frames[0][0], frames[1][0]
    for ridge in (block, single):
        ridge.learn(x, targets, -1.0)
        ridge.retarget(x, np.array([-1.0, 1.0, 0.0]))
    assert_same(block, single, frames)


def test_a_new_label_is_zero_for_frames_that_wait(frames):
    block, single = taught(frames, 5)
    for ridge in (block, single):
        ridge.add_label()
    assert_same(block, single, frames)
    x, targets = frames[0][9], np.array([0.0, 0.0, 0.0, 1.0])
    block.learn_scaled(single.scaled(x), targets)
    single.learn(x, targets)
    assert_same(block, single, frames)
    assert block.scores(x)[3] > 0.0


def test_frames_taken_back_too_often_do_not_stop_it(frames):
    """The inverse is then not positive; a block has to be learned one by one."""
    block, single = taught(frames, 4)
    for ridge in (block, single):
        ridge.learn(frames[0][0], frames[1][0], -3.0)
    for x, targets in zip(frames[0][4:], frames[1][4:], strict=True):
        block.learn_scaled(single.scaled(x), targets)
        single.learn(x, targets)
    x = frames[0][0]
    np.testing.assert_allclose(block.scores(x), single.scores(x), atol=1e-9)
