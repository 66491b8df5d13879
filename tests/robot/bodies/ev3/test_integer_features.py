from __future__ import annotations

import math

import numpy as np
import pytest

from robot.bodies.ev3.integer_features import IntegerGradientFeatures
from robot.types import Encoding
from tests.kit.frames import make_frame

FEATURES = IntegerGradientFeatures()
N = FEATURES.n_gradients


def frame(grey, encoding=Encoding.YUYV):
    height, width = grey.shape
    pixels = np.repeat(grey.astype(np.uint8)[:, :, None], 3, axis=2)
    if encoding is Encoding.YUYV:
        pixels = pixels[:, :, :2].copy()
        pixels[:, :, 1] = 128
    return make_frame(pixels.tobytes(), encoding, width, height)


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


@pytest.mark.parametrize("seed", range(4))
def test_integer_features_equal_those_from_angles_and_roots(seed):
    found = FEATURES.extract(frame(room(seed)))[:N].astype(float)
    expected = plainly(room(seed)).ravel()
    assert not (found % 4).any()
    assert np.abs(found - expected).mean() < 6.0  # lengths are in steps of a half
    assert np.corrcoef(found, expected)[0, 1] > 0.99


def test_the_thumbnail_shows_the_whole_picture():
    x = FEATURES.extract(frame(room()))
    assert x.shape == (FEATURES.n_gradients + 1200,) and x.dtype == np.uint8
    assert np.array_equal(FEATURES.thumbnail(x), 2 * half(room()))
    assert np.array_equal(FEATURES.grey(x), half(room())[::2, ::2].ravel())


def test_every_encoding_and_size_gives_a_vector():
    x = FEATURES.extract(frame(room()))
    assert np.array_equal(x, FEATURES.extract(frame(room(), Encoding.RGB)))
    large = FEATURES.extract(frame(np.kron(room(), np.ones((2, 2)))))
    assert large.shape == x.shape
    assert np.corrcoef(large[:N], x[:N])[0, 1] > 0.8
    assert FEATURES.extract(frame(room()[::6, ::6])).shape == x.shape
    small = FEATURES.extract(frame(room()[::2, ::2]))
    assert np.corrcoef(small[N:], x[N:])[0, 1] > 0.8


def test_gradients_stay_when_the_light_changes():
    bright, dim, other = (
        FEATURES.extract(frame(pixels))[:N].astype(float)
        for pixels in (room(), room() * 0.6, room()[:, ::-1])
    )
    assert np.linalg.norm(bright - dim) < 0.3 * np.linalg.norm(bright - other)


def test_black_beside_white_in_every_direction_is_in_the_table():
    """The largest differences, which would overflow first."""
    for across in (-1, 0, 1):
        for down in (-1, 0, 1):
            rows, columns = np.mgrid[0:120, 0:160]
            is_white = across * (columns - 80) + down * (rows - 60) > 0
            x = FEATURES.extract(frame(np.where(is_white, 255, 0)))[:N].reshape(20, 8)
            turn = round(math.atan2(down, across) / (math.pi / 4)) % 8
            assert bool(x.any()) is bool(across or down)
            assert not x.any() or x.astype(int).sum(axis=0).argmax() == turn


def test_the_parts_of_a_distance_add_up_and_lie_where_the_difference_is():
    one, other = room(), room()
    other[60:, :80] = room(9)[60:, :80]
    x, y = (FEATURES.extract(frame(grey)).astype(float) for grey in (one, other))
    cells = FEATURES.cells(x - y)
    compared = (x - y)[: FEATURES.n_compared]
    assert cells.shape == (6, 8) and cells.sum() == pytest.approx(compared @ compared)
    assert cells[3:, :4].sum() > 0.7 * cells.sum()
