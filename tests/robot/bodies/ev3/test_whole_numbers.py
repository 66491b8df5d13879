"""The brick's integer features and regression equal plain computations with floats.

tests/robot/learner/test_properties.py tests the regression inside a learner.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.bodies.ev3 import integer_ridge
from robot.bodies.ev3.integer_features import IntegerGradientFeatures
from robot.bodies.ev3.integer_ridge import IntegerRidge
from robot.types import Encoding
from tests.kit.frames import frame_of, make_frame

FEATURES = IntegerGradientFeatures()
N = FEATURES.n_gradients
SIZE = 12
LABELS = np.eye(3)


def room(seed=3):
    coarse = np.random.default_rng(seed).integers(0, 255, (12, 16))
    noise = np.random.default_rng(seed + 1).integers(-9, 10, (120, 160))
    return (np.kron(coarse, np.ones((10, 10))) + noise).clip(0, 255).astype(np.uint8)


def half(grey):
    middle = grey.astype(int)
    return (middle[1::4, 1::4] + middle[1::4, 2::4] + middle[2::4, 1::4] + middle[2::4, 2::4]) >> 3


def plainly(grey):
    """The histograms computed directly: angles, lengths and roots."""
    picture = half(grey)
    cells = np.zeros((5, 4, 8))
    for row in range(30):
        for column in range(40):
            across = picture[row, column + 1] - picture[row, column - 1] if 0 < column < 39 else 0
            down = picture[row + 1, column] - picture[row - 1, column] if 0 < row < 29 else 0
            turn = round(math.atan2(down, across) / (math.pi / 4)) % 8
            cells[row // 6, column // 10, turn] += math.hypot(across, down)
    energy = np.pad(cells.sum(axis=2), 1)
    around = sum(energy[r : r + 5, c : c + 4] for r in range(3) for c in range(3))
    return 252 * np.sqrt(np.minimum(4 * cells / (around + 100)[:, :, None], 1.0))


@pytest.mark.parametrize("seed", range(2))
def test_integer_features_equal_those_from_angles_and_roots(seed):
    grey = room(seed)
    x = FEATURES.extract(frame_of(grey))
    assert x.shape == (N + 1200,) and x.dtype == np.uint8
    found, expected = x[:N].astype(float), plainly(grey).ravel()
    assert not (found % 4).any()
    assert np.abs(found - expected).mean() < 6.0  # lengths are multiples of a half
    assert np.corrcoef(found, expected)[0, 1] > 0.99
    assert np.array_equal(FEATURES.thumbnail(x), 2 * half(grey))
    assert np.array_equal(FEATURES.grey(x), half(grey)[::2, ::2].ravel())


def test_every_encoding_and_size_gives_a_vector():
    x = FEATURES.extract(frame_of(room()))
    yuyv = np.stack([room(), np.full((120, 160), 128, np.uint8)], axis=2)
    assert np.array_equal(x, FEATURES.extract(make_frame(yuyv.tobytes(), Encoding.YUYV)))
    large = FEATURES.extract(frame_of(np.kron(room(), np.ones((2, 2)))))
    assert large.shape == x.shape and np.corrcoef(large[:N], x[:N])[0, 1] > 0.8
    small = FEATURES.extract(frame_of(room()[::2, ::2]))
    assert small.shape == x.shape and np.corrcoef(small[N:], x[N:])[0, 1] > 0.8


def test_black_beside_white_in_every_direction_is_in_the_table():
    """A picture with the largest differences, whose sums would be the first to overflow."""
    for across in (-1, 0, 1):
        for down in (-1, 0, 1):
            rows, columns = np.mgrid[0:120, 0:160]
            is_white = across * (columns - 80) + down * (rows - 60) > 0
            x = FEATURES.extract(frame_of(np.where(is_white, 255, 0)))[:N].reshape(20, 8)
            turn = round(math.atan2(down, across) / (math.pi / 4)) % 8
            assert bool(x.any()) is bool(across or down)
            assert not x.any() or x.astype(int).sum(axis=0).argmax() == turn


def test_the_parts_of_a_distance_add_up_and_lie_where_the_difference_is():
    one, other = room(), room()
    other[60:, :80] = room(9)[60:, :80]
    x, y = (FEATURES.extract(frame_of(grey)).astype(float) for grey in (one, other))
    cells = FEATURES.cells(x - y)
    compared = (x - y)[: FEATURES.n_compared]
    assert cells.shape == (6, 8) and cells.sum() == pytest.approx(compared @ compared)
    assert cells[3:, :4].sum() > 0.7 * cells.sum()


def lessons(n, seed=0):
    """Frames whose values depend on the label, apart from noise."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 3, n)
    centres = rng.integers(0, 256, (3, SIZE))
    xs = (centres[labels] + rng.integers(-80, 81, (n, SIZE))).clip(0, 255).astype(np.uint8)
    return xs // 4 * 4, LABELS[labels]  # multiples of 4, like the features


def taught(xs, targets, **more):
    ridge = IntegerRidge(SIZE, **more)
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


@pytest.mark.parametrize("steps", [1, 20])
def test_the_sums_are_exact_whatever_is_learned_unlearned_and_relabelled(steps):
    xs, targets = lessons(300)
    targets[:20] = LABELS[0]
    ridge = IntegerRidge(SIZE, steps=steps)
    ridge.add_label()
    for x in xs[:20]:
        ridge.learn(x, np.array([1.0]))
    ridge.add_label()
    ridge.add_label()
    assert ridge.scores(xs[0])[1:].tolist() == [0.0, 0.0], "new labels start at zero"
    for x, target in zip(xs[20:], targets[20:], strict=True):
        ridge.learn(x, target)
    for x, target in zip(xs[200:], targets[200:], strict=True):
        ridge.forget(x, target, 1.0)
    ridge.retarget(xs[0], LABELS[2] - targets[0])
    xs, targets = xs[:200], targets[:200].astype(int)
    targets[0] = LABELS[2]
    z = np.hstack([xs.astype(object) // 4, np.full((200, 1), 63, object)])
    assert (ridge.save()[1]["products"] - z.T.dot(z) == np.diag([round(3.0 * 63**2)] * 13)).all()
    assert (moments(ridge) == (1 << 24) * targets.T.astype(object).dot(z)).all()


def test_few_steps_come_close_to_batch_ridge_and_many_steps_reach_it():
    xs, targets = lessons(400)
    z = np.hstack([xs // 4 / 63.0, np.ones((400, 1))])
    expected = z @ np.linalg.solve(z.T @ z + 3.0 * np.eye(SIZE + 1), z.T @ targets)
    few, many = (
        np.array([ridge.scores(x) for x in xs])
        for ridge in (taught(xs, targets, steps=4), taught(xs, targets, steps=400))
    )
    np.testing.assert_allclose(many, expected, atol=1e-3)
    assert np.abs(few - expected).max() < 0.05
    assert (few.argmax(axis=1) == expected.argmax(axis=1)).mean() > 0.98


def test_many_frames_are_halved_before_they_overflow_and_the_scores_stay(monkeypatch):
    # a lower bound, which is reached after 67 instead of 270,000 frames
    monkeypatch.setattr(integer_ridge, "_FULL", 1 << 18)
    xs, targets = lessons(1000)
    ridge = taught(xs, targets)
    arrays = ridge.save()[1]
    assert arrays["halvings"][0] > 5
    assert arrays["products"].max() < (1 << 18) + 63**2
    assert np.linalg.eigvalsh(arrays["products"].astype(float)).min() > 0.0
    before = np.array([ridge.scores(x) for x in xs])
    assert (before.argmax(axis=1) == targets.argmax(axis=1)).mean() > 0.9
    ridge._halve()
    assert np.array_equal(before, [ridge.scores(x) for x in xs])


def test_models_of_other_features_and_impossible_ones_are_refused():
    arrays = taught(*lessons(30)).save()[1]
    with pytest.raises(ValueError, match=r"the array products|the array residual|the array linear"):
        IntegerRidge(SIZE + 1).load({}, arrays)
    for halvings in (-1, 2**40):
        ridge = IntegerRidge(SIZE)
        ridge.load({}, {**arrays, "halvings": np.array([halvings], np.int64)})
        with pytest.raises(ValueError, match="halvings"):
            ridge.check()
    for n_features, steps in ((0, 4), (3, 0)):
        with pytest.raises(ValueError, match="above 0"):
            IntegerRidge(n_features, steps=steps)
