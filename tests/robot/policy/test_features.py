from __future__ import annotations

import numpy as np
import pytest

from robot.learner.ridge import RecursiveRidge
from robot.policy.features import GradientFeatures, GreyFeatures
from tests.kit.frames import frame_of


@pytest.fixture
def room():
    rng = np.random.default_rng(3)
    coarse = rng.integers(0, 255, (12, 16))
    return np.kron(coarse, np.ones((10, 10)))


@pytest.mark.parametrize("features", [GreyFeatures(), GradientFeatures()], ids=lambda f: f.name)
def test_vector_is_finite_pure_and_shows_its_thumbnail(features, room):
    x = features.extract(frame_of(room))
    assert x.ndim == 1
    assert np.isfinite(x).all()
    assert np.array_equal(x, features.extract(frame_of(room)))
    grey = GreyFeatures().extract(frame_of(room)).reshape(30, 40)
    assert np.abs(features.thumbnail(x).astype(int) - grey).max() <= 2


def test_gradients_stay_when_the_light_changes(room):
    features = GradientFeatures()
    n = features.n_gradients
    bright, dim, other = (
        features.extract(frame_of(pixels))[:n].astype(float)
        for pixels in (room, room * 0.6, room[:, ::-1])
    )
    assert np.linalg.norm(bright - dim) < 0.1 * np.linalg.norm(bright - other)


def test_a_plain_frame_has_no_gradients():
    features = GradientFeatures()
    assert not features.extract(frame_of(np.full((120, 160), 77.0)))[: features.n_gradients].any()


@pytest.mark.parametrize("turn", range(8))
def test_each_direction_has_its_bin(turn):
    rows, columns = np.mgrid[0:120, 0:160]
    angle = turn * np.pi / 4
    ramp = 128 + 0.9 * ((columns - 80) * np.cos(angle) + (rows - 60) * np.sin(angle))
    x = GradientFeatures().extract(frame_of(ramp.round()))[: GradientFeatures.n_gradients]
    assert x.reshape(48, 8).astype(int).sum(axis=0).argmax() == turn


@pytest.mark.parametrize("size", [(2, 2), (3, 3), (4, 4), (2, 4), (9, 9)])
def test_a_view_is_the_same_to_a_camera_of_any_size(room, size):
    """A model taught by a webcam of 160x120 knows the view of a phone's larger camera."""
    features = GradientFeatures()
    large = np.kron(room, np.ones(size))
    assert np.array_equal(features.extract(frame_of(large)), features.extract(frame_of(room)))


@pytest.mark.parametrize("size", [(1, 1), (60, 80), (84, 84), (96, 96), (119, 300)])
def test_a_small_picture_is_enlarged(size):
    down, across = np.mgrid[0 : size[0], 0 : size[1]]
    slope = 255 * (down / size[0] + across / size[1]) / 2
    x = GradientFeatures().extract(frame_of(slope))
    full = np.mgrid[0:120, 0:160]
    same = GradientFeatures().extract(frame_of(255 * (full[0] / 120 + full[1] / 160) / 2))
    assert x.shape == same.shape
    assert size == (1, 1) or np.corrcoef(x[384:], same[384:])[0, 1] > 0.98


def test_an_edge_is_recognised_in_the_neighbouring_cell():
    """Two views that differ in one cell only; then the same views shifted sideways by a cell."""

    def view(column: int, is_left: bool) -> np.ndarray:
        x = np.zeros(GradientFeatures.n_gradients, np.uint8)
        x.reshape(6, 8, 8)[3, column, 0 if is_left else 4] = 200
        return x

    margins = []
    for alike in (GradientFeatures.alike(), None):
        ridge = RecursiveRidge(GradientFeatures.n_gradients, alike=alike)
        for _ in range(2):
            ridge.add_label()
        for _ in range(5):
            ridge.learn(view(3, True), np.array([1.0, 0.0]))
            ridge.learn(view(3, False), np.array([0.0, 1.0]))
        left, right = ridge.scores(view(4, True)), ridge.scores(view(4, False))
        margins.append((left[0] - left[1], right[1] - right[0]))
    assert min(margins[0]) > 0.1
    np.testing.assert_allclose(margins[1], 0.0, atol=1e-6)
