"""Ridge regression of all examples, and of the examples of each context."""

from __future__ import annotations

import numpy as np
import pytest

from robot.learner.linear import N_CONTEXTS
from robot.learner.ridge import ContextRidge, RecursiveRidge

CLOSE = 1e-5
"""Tolerance of scores, because the inverse is in single precision."""
SIZE = 6
ALL = range(N_CONTEXTS)


def batch(xs, targets, penalty=2.0):
    """Return the weights of batch ridge regression, with a constant feature."""
    z = np.hstack([xs, np.ones((len(xs), 1))])
    return np.linalg.solve(z.T @ z + penalty * np.eye(z.shape[1]), z.T @ targets)


@pytest.fixture
def lessons():
    rng = np.random.default_rng(0)
    return rng.normal(size=(50, SIZE)), np.eye(3)[rng.integers(0, 3, 50)]


def taught(xs, targets, **more):
    ridge = RecursiveRidge(SIZE, penalty=2.0, scale=1.0, **more)
    for _ in range(3):
        ridge.add_label()
    for x, target in zip(xs, targets, strict=True):
        ridge.learn(x, target)
    return ridge


def test_incremental_ridge_equals_batch_ridge(lessons):
    xs, targets = lessons
    ridge = RecursiveRidge(SIZE, penalty=2.0, scale=1.0)
    ridge.add_label()
    ridge.add_label()
    for x, target in zip(xs[:10], targets[:10, :2], strict=True):
        ridge.learn(x, target)
    ridge.add_label()
    for x, target in zip(xs[10:], targets[10:], strict=True):
        ridge.learn(x, target)
    known = targets.copy()
    known[:10, 2] = 0.0
    expected = batch(xs, known)
    np.testing.assert_allclose(ridge.scores(xs[3]), np.append(xs[3], 1.0) @ expected, atol=CLOSE)


def test_with_symmetric_weights_the_ridge_equals_batch_ridge_with_that_covariance(lessons):
    xs, targets = lessons
    places = np.arange(SIZE)
    alike = 0.3 * np.eye(SIZE) + 0.7 * np.exp(-0.5 * (places[:, None] - places) ** 2)
    ridge = taught(xs, targets, alike=alike)
    z = np.hstack([xs, np.ones((50, 1))])
    precision = np.eye(7)
    precision[:SIZE, :SIZE] = np.linalg.inv(alike)
    expected = np.linalg.solve(z.T @ z + 2.0 * precision, z.T @ targets)
    np.testing.assert_allclose(ridge.scores(xs[3]), z[3] @ expected, atol=CLOSE)
    for x, target in zip(xs, targets, strict=True):
        ridge.forget(x, target, 1.0)
    np.testing.assert_allclose(ridge.scores(xs[3]), 0.0, atol=1e-3)
    ridge.check()


def test_examples_can_be_unlearned_and_relabelled(lessons):
    xs, targets = lessons
    ridge = taught(xs, targets)
    ridge.forget(xs[0], targets[0], 1.0)
    ridge.retarget(xs[1], np.array([1.0, 0.0, 0.0]) - targets[1])
    changed = targets.copy()
    changed[1] = [1.0, 0.0, 0.0]
    expected = batch(xs[1:], changed[1:])
    np.testing.assert_allclose(ridge.scores(xs[7]), np.append(xs[7], 1.0) @ expected, atol=CLOSE)


def test_incremental_ridge_stays_exact_over_many_frames():
    rng = np.random.default_rng(1)
    xs = rng.integers(0, 256, (20000, 20)).astype(np.uint8)
    targets = (xs[:, :1] > xs[:, 1:2]).astype(float)
    ridge = RecursiveRidge(20)
    ridge.add_label()
    for x, target in zip(xs, targets, strict=True):
        ridge.learn(x, target)
    expected = np.append(xs[5] / 255.0, 1) @ batch(xs / 255.0, targets, 3.0)
    np.testing.assert_allclose(ridge.scores(xs[5]), expected, atol=CLOSE)


# Contexts ---------------------------------------------------------------------------------------


@pytest.fixture
def examples(lessons):
    """Vectors with their targets and the contexts in which they count."""
    rng = np.random.default_rng(2)
    some = [tuple(c for c in ALL if rng.random() < 0.6) for _ in range(50)]
    return list(zip(*lessons, some, strict=True))


def in_contexts(examples):
    ridge = ContextRidge(SIZE, penalty=2.0, scale=1.0)
    for _ in range(3):
        ridge.add_label()
    for x, target, contexts in examples:
        ridge.learn(x, target, contexts=contexts)
    return ridge


def alone(examples, context=None):
    """Return a single ridge that learned the examples of one context, or all."""
    own = [(x, target) for x, target, some in examples if context is None or context in some]
    return taught([x for x, _ in own], [target for _, target in own])


@pytest.mark.parametrize("together", [0, 3, 8, 30])
def test_contexts_are_one_until_they_differ(examples, together):
    """Only the common ridge learns the first frames, which count in all contexts. Later, each
    context's ridge learns its own examples, and the common ridge learns all."""
    mixed = [(x, t, ALL if i < together else some) for i, (x, t, some) in enumerate(examples)]
    ridge = in_contexts(mixed[:together])
    arrays = ridge.save()[1]
    assert not any(name.startswith(("context0", "context1")) for name in arrays)
    again = in_contexts([])
    again.load({}, arrays)
    for x, target, contexts in mixed[together:]:
        for one in (ridge, again):
            one.learn(x, target, contexts=contexts)
    for name, array in ridge.save()[1].items():
        assert np.array_equal(array, again.save()[1][name]), "both ridges learn the same"
    x = examples[2][0]
    np.testing.assert_array_equal(ridge.scores(x), alone(mixed).scores(x))
    for context in ALL:
        expected = alone(mixed, context).scores(x)
        np.testing.assert_allclose(ridge.scores(x, context), expected, atol=1e-12)


def test_an_example_that_counts_everywhere_is_taken_back_everywhere(examples):
    everywhere = [(x, target, ALL) for x, target, _ in examples]
    ridge = in_contexts(everywhere)
    x, target, _ = everywhere[0]
    ridge.forget(x, target, 1.0)
    expected = alone(everywhere[1:]).scores(x)
    for context in (None, *ALL):
        np.testing.assert_allclose(ridge.scores(x, context), expected, atol=1e-5)


def test_each_context_changes_by_its_share_of_the_label(examples):
    """Label 0 becomes label 1. A context that has learned half of the label's frames gets half of
    the change."""
    zeros = [(x, np.eye(3)[0], (0, 1) if i % 2 else (1,)) for i, (x, *_) in enumerate(examples)]
    ridge, x, change = in_contexts(zeros), examples[3][0], np.array([-4.0, 4.0, 0.0])
    before = [ridge.scores(x, context) for context in ALL]
    ridge.retarget(x, change)
    for context, share in zip(ALL, [0.5, 1.0], strict=True):
        pure = alone(zeros, context)
        pure.retarget(x, share * change)
        after = ridge.scores(x, context)
        np.testing.assert_allclose(after, pure.scores(x), atol=1e-12)
        assert after[0] < before[context][0]


def test_a_context_without_frames_of_a_label_keeps_its_targets(examples):
    ridge = in_contexts([(x, np.eye(3)[0], (1,)) for x, *_ in examples])
    x = examples[0][0]
    ridge.retarget(x, np.array([-4.0, 4.0, 0.0]))
    ridge.forget(x, np.array([1.0, 0.0, 0.0]), 1.0)
    assert not ridge.scores(x, 0).any()
    assert ridge.scores(x, 1).any()
