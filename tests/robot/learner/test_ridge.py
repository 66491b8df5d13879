from __future__ import annotations

import numpy as np
import pytest

from robot.learner.ridge import RecursiveRidge

CLOSE = 1e-5
"""Largest difference of scores from exact ones, because the inverse is in single precision."""


def batch(xs, targets, weights, penalty):
    z = np.hstack([xs, np.ones((len(xs), 1))])
    a = z.T @ (weights[:, None] * z) + penalty * np.eye(z.shape[1])
    return np.linalg.solve(a, z.T @ (weights[:, None] * targets))


@pytest.fixture
def lessons():
    rng = np.random.default_rng(0)
    return rng.normal(size=(50, 6)), np.eye(3)[rng.integers(0, 3, 50)]


def taught(xs, targets, **more):
    ridge = RecursiveRidge(6, penalty=2.0, scale=1.0, **more)
    for _ in range(3):
        ridge.add_label()
    for x, target in zip(xs, targets, strict=True):
        ridge.learn(x, target)
    return ridge


def test_equals_batch_ridge(lessons):
    xs, targets = lessons
    ridge = RecursiveRidge(6, penalty=2.0, scale=1.0)
    ridge.add_label()
    ridge.add_label()
    for x, target in zip(xs[:10], targets[:10, :2], strict=True):
        ridge.learn(x, target)
    ridge.add_label()
    for x, target in zip(xs[10:], targets[10:], strict=True):
        ridge.learn(x, target)
    known = targets.copy()
    known[:10, 2] = 0.0
    expected = batch(xs, known, np.ones(50), 2.0)
    np.testing.assert_allclose(ridge.scores(xs[3]), np.append(xs[3], 1.0) @ expected, atol=CLOSE)


def test_with_alike_weights_it_equals_batch_ridge_under_that_covariance(lessons):
    xs, targets = lessons
    places = np.arange(6)
    alike = 0.3 * np.eye(6) + 0.7 * np.exp(-0.5 * (places[:, None] - places) ** 2)
    ridge = taught(xs, targets, alike=alike)
    z = np.hstack([xs, np.ones((50, 1))])
    precision = np.eye(7)
    precision[:6, :6] = np.linalg.inv(alike)
    expected = np.linalg.solve(z.T @ z + 2.0 * precision, z.T @ targets)
    np.testing.assert_allclose(ridge.scores(xs[3]), z[3] @ expected, atol=CLOSE)
    for x, target in zip(xs, targets, strict=True):
        ridge.forget(x, target, 1.0)
    np.testing.assert_allclose(ridge.scores(xs[3]), 0.0, atol=1e-3)
    ridge.check()


def test_takes_back_and_relabels(lessons):
    xs, targets = lessons
    ridge = taught(xs, targets)
    ridge.forget(xs[0], targets[0], 1.0)
    ridge.retarget(xs[1], np.array([1.0, 0.0, 0.0]) - targets[1])
    changed = targets.copy()
    changed[1] = [1.0, 0.0, 0.0]
    expected = batch(xs[1:], changed[1:], np.ones(49), 2.0)
    np.testing.assert_allclose(ridge.scores(xs[7]), np.append(xs[7], 1.0) @ expected, atol=CLOSE)


def test_stays_exact_over_many_frames():
    rng = np.random.default_rng(1)
    xs = rng.integers(0, 256, (20000, 20)).astype(np.uint8)
    targets = (xs[:, :1] > xs[:, 1:2]).astype(float)
    ridge = RecursiveRidge(20)
    ridge.add_label()
    for x, target in zip(xs, targets, strict=True):
        ridge.learn(x, target)
    expected = batch(xs / 255.0, targets, np.ones(20000), 3.0)
    np.testing.assert_allclose(
        ridge.scores(xs[5]), np.append(xs[5] / 255.0, 1) @ expected, atol=CLOSE
    )


def test_saved_between_any_two_frames_it_goes_on_bit_for_bit(lessons):
    xs, targets = lessons
    for cut in range(20):
        whole, other = taught(xs[:cut], targets[:cut]), RecursiveRidge(6, penalty=2.0, scale=1.0)
        other.load({}, whole.save()[1])
        for x, target in zip(xs[cut:], targets[cut:], strict=True):
            whole.learn(x, target)
            other.learn(x, target)
        one, two = whole.save()[1], other.save()[1]
        assert all(np.array_equal(one[name], two[name]) for name in one)


def test_its_inverse_is_symmetric_to_the_last_bit(lessons):
    ridge = taught(*lessons)
    np.testing.assert_array_equal(ridge._inverse, ridge._inverse.T)
