from __future__ import annotations

import numpy as np
import pytest

from robot.bodies.ev3 import integer_ridge
from robot.bodies.ev3.integer_ridge import IntegerRidge

N = 12
LABELS = np.eye(3)


def batch(xs, targets, penalty=3.0):
    z = np.hstack([xs // 4 / 63.0, np.ones((len(xs), 1))])
    return np.linalg.solve(z.T @ z + penalty * np.eye(z.shape[1]), z.T @ targets)


def lessons(n, seed=0):
    """Frames in which every label has values of its own, apart from noise."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 3, n)
    centres = rng.integers(0, 256, (3, N))
    xs = (centres[labels] + rng.integers(-80, 81, (n, N))).clip(0, 255).astype(np.uint8)
    return xs // 4 * 4, LABELS[labels]  # as the features give them


def taught(xs, targets, **more):
    ridge = IntegerRidge(N, **more)
    for _ in range(3):
        ridge.add_label()
    for x, target in zip(xs, targets, strict=True):
        ridge.learn(x, target)
    return ridge


def moments(ridge):
    """The value of the residual in Python's integers, which never overflow."""
    arrays = ridge.save()[1]
    products = arrays["products"].astype(object)
    return arrays["residual"].astype(object) + arrays["linear"].astype(object).dot(products)


@pytest.mark.parametrize("steps", [1, 4, 9])
def test_its_sums_are_exact_after_any_number_of_frames(steps):
    xs, targets = lessons(300)
    ridge = taught(xs, targets, steps=steps)
    z = np.hstack([xs.astype(object) // 4, np.full((300, 1), 63, object)])
    assert (ridge.save()[1]["products"] - z.T.dot(z) == np.diag([round(3.0 * 63**2)] * 13)).all()
    assert (moments(ridge) == (1 << 24) * targets.astype(int).T.astype(object).dot(z)).all()


def test_comes_close_to_batch_ridge_with_few_steps_and_to_it_with_many():
    xs, targets = lessons(400)
    expected = np.hstack([xs // 4 / 63.0, np.ones((400, 1))]) @ batch(xs, targets)
    few, many = (
        np.array([ridge.scores(x) for x in xs])
        for ridge in (taught(xs, targets, steps=4), taught(xs, targets, steps=400))
    )
    np.testing.assert_allclose(many, expected, atol=1e-3)
    assert np.abs(few - expected).max() < 0.05
    assert (few.argmax(axis=1) == expected.argmax(axis=1)).mean() > 0.98


def test_a_new_label_begins_at_zero_and_is_learned():
    ridge = IntegerRidge(N)
    ridge.add_label()
    xs, targets = lessons(200)
    for x in xs[:20]:
        ridge.learn(x, np.array([1.0]))
    ridge.add_label()
    ridge.add_label()
    assert ridge.scores(xs[0])[1:].tolist() == [0.0, 0.0]
    for x, target in zip(xs, targets, strict=True):
        ridge.learn(x, target)
    right = [ridge.scores(x).argmax() == t.argmax() for x, t in zip(xs, targets, strict=True)]
    assert np.mean(right) > 0.9


@pytest.mark.parametrize("seed", range(5))
def test_unlearned_frames_leave_no_trace(seed):
    xs, targets = lessons(120, seed)
    kept, gone = slice(0, 80), slice(80, 120)
    ridge = taught(xs, targets, steps=20)
    for x, target in zip(xs[gone], targets[gone], strict=True):
        ridge.forget(x, target, 1.0)
    never = taught(xs[kept], targets[kept], steps=20)
    assert (ridge.save()[1]["products"] == never.save()[1]["products"]).all()
    assert (moments(ridge) == moments(never)).all()


def test_frames_that_are_relabelled_count_for_the_new_label():
    xs, targets = lessons(100)
    ridge = taught(xs, targets, steps=200)
    ridge.retarget(xs[0], LABELS[2] - targets[0])
    targets = targets.copy()
    targets[0] = LABELS[2]
    assert (moments(ridge) == moments(taught(xs, targets))).all()


def test_many_frames_are_halved_before_they_overflow_and_the_scores_stay(monkeypatch):
    monkeypatch.setattr(integer_ridge, "_FULL", 1 << 18)  # 67 frames, in place of 270,000
    xs, targets = lessons(1000)
    ridge = taught(xs, targets)
    arrays = ridge.save()[1]
    assert arrays["halvings"][0] > 5
    assert arrays["products"].max() < (1 << 18) + 63**2
    assert np.linalg.eigvalsh(arrays["products"].astype(float)).min() > 0.0
    right = [ridge.scores(x).argmax() == t.argmax() for x, t in zip(xs, targets, strict=True)]
    assert np.mean(right) > 0.9
    before = np.array([ridge.scores(x) for x in xs[:50]])
    ridge._halve()
    assert np.array_equal(before, [ridge.scores(x) for x in xs[:50]])


def test_the_same_view_with_every_label_in_turn_stays_in_bounds():
    ridge = taught([], [])
    x = np.full(N, 255, np.uint8)
    for i in range(3000):
        ridge.learn(x, LABELS[i % 3])
    np.testing.assert_allclose(ridge.scores(x), 1 / 3, atol=0.01)


def test_models_of_other_features_and_impossible_ones_are_refused():
    arrays = taught(*lessons(30)).save()[1]
    with pytest.raises(ValueError, match=r"the array products|the array residual|the array linear"):
        IntegerRidge(N + 1).load({}, arrays)
    for halvings in (-1, 2**40):
        ridge = IntegerRidge(N)
        ridge.load({}, {**arrays, "halvings": np.array([halvings], np.int64)})
        with pytest.raises(ValueError, match="halvings"):
            ridge.check()
    for bad in (
        {"n_features": 0},
        {"n_features": 3, "steps": 0},
    ):
        with pytest.raises(ValueError, match="above 0"):
            IntegerRidge(**bad)
