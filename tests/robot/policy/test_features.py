"""A camera's frame becomes a grey picture, and then the vector that a learner sees."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot.devices.encoders import jpeg_encoder
from robot.errors import CameraError
from robot.learner.ridge import RecursiveRidge
from robot.policy import image
from robot.policy.features import GradientFeatures, GreyFeatures
from robot.types import Encoding
from tests.kit.frames import frame_of, make_frame
from tests.kit.sizes import crossed


def frame(data, encoding):
    return make_frame(data, encoding, width=16, height=12)


def apart(one, other):
    return np.abs(one.astype(int) - other).max()


def test_grey_is_the_same_from_rgb_and_from_any_jpeg():
    ramp = np.linspace(20, 220, 16)[None, :] + np.linspace(0, 30, 12)[:, None]
    smooth = np.stack([ramp, ramp[:, ::-1], np.full((12, 16), 90)], axis=2).astype(np.uint8)
    grey = image.to_grey(frame(smooth.tobytes(), Encoding.RGB))
    assert apart(grey, cv2.cvtColor(smooth, cv2.COLOR_RGB2GRAY)) <= 1
    bgr = np.ascontiguousarray(smooth[:, :, ::-1])
    packed = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()
    assert apart(grey, image.to_grey(frame(packed, Encoding.JPEG))) <= 3
    own_tables = [cv2.IMWRITE_JPEG_QUALITY, 75, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    optimised = cv2.imencode(".jpg", bgr, own_tables)[1].tobytes()
    assert np.array_equal(image.decode(jpeg_encoder(75)(smooth)), image.decode(optimised))


def test_yuyv_to_rgb_agrees_with_opencv():
    yuyv = np.random.default_rng(1).integers(60, 190, (12, 16, 2)).astype(np.uint8)
    v, u = np.repeat(yuyv[:, 1::2, 1], 2, axis=1), np.repeat(yuyv[:, 0::2, 1], 2, axis=1)
    theirs = cv2.cvtColor(np.stack([yuyv[:, :, 0], v, u], axis=2), cv2.COLOR_YCrCb2RGB)
    assert apart(image.to_rgb(frame(yuyv.tobytes(), Encoding.YUYV)), theirs) <= 2
    assert np.array_equal(image.to_grey(frame(yuyv.tobytes(), Encoding.YUYV)), yuyv[:, :, 0])


@crossed(encoding=list(Encoding), data=[b"", b"not an image"])
def test_invalid_image_bytes_are_a_camera_error(encoding, data):
    for convert in (image.to_grey, image.to_rgb):
        with pytest.raises(CameraError):
            convert(frame(data, encoding))


@pytest.mark.parametrize("times", [2, 4, 3])
def test_shrinking_averages_areas(times):
    grey = np.random.default_rng(2).integers(0, 256, (30 * times, 40 * times), dtype=np.uint8)
    exact = grey.reshape(30, times, 40, times).mean(axis=(1, 3))
    if times in (2, 4):  # these fast functions round half to even
        exact = np.rint(exact)
        colour = np.repeat(grey[:, :, None], 3, axis=2)
        assert np.array_equal(image.shrink(colour, 40, 30)[:, :, 1], exact)
    assert apart(image.shrink(grey, 40, 30), exact) <= (0 if times in (2, 4) else 0.5)
    assert image.shrink(grey, 7, 5).shape == (5, 7)


@pytest.fixture
def room():
    return np.kron(np.random.default_rng(3).integers(0, 255, (12, 16)), np.ones((10, 10)))


@pytest.mark.parametrize("features", [GreyFeatures(), GradientFeatures()], ids=lambda f: f.name)
def test_vector_is_finite_pure_and_shows_its_thumbnail(features, room):
    x = features.extract(frame_of(room))
    assert x.ndim == 1 and np.isfinite(x).all()
    assert np.array_equal(x, features.extract(frame_of(room)))
    assert apart(features.thumbnail(x), GreyFeatures().extract(frame_of(room)).reshape(30, 40)) <= 2


def gradients(pixels):
    features = GradientFeatures()
    return features.extract(frame_of(pixels))[: features.n_gradients].astype(int)


def test_gradients_stay_when_the_light_changes(room):
    bright, dim, other = (gradients(pixels) for pixels in (room, room * 0.6, room[:, ::-1]))
    assert np.linalg.norm(bright - dim) < 0.1 * np.linalg.norm(bright - other)
    assert not gradients(np.full((120, 160), 77.0)).any(), "a plain frame has no gradients"


@pytest.mark.parametrize("turn", range(8))
def test_each_direction_has_its_bin(turn):
    rows, columns = np.mgrid[0:120, 0:160]
    angle = turn * np.pi / 4
    ramp = 128 + 0.9 * ((columns - 80) * np.cos(angle) + (rows - 60) * np.sin(angle))
    assert gradients(ramp.round()).reshape(48, 8).sum(axis=0).argmax() == turn


@pytest.mark.parametrize("size", [(2, 2), (4, 4), (2, 4), (9, 9)])
def test_a_view_is_the_same_to_a_camera_of_any_size(room, size):
    """A model taught with a webcam of 160x120 recognises the view of a phone's larger camera."""
    extract = GradientFeatures().extract
    assert np.array_equal(extract(frame_of(np.kron(room, np.ones(size)))), extract(frame_of(room)))


@pytest.mark.parametrize("size", [(1, 1), (60, 80), (96, 96), (119, 300)])
def test_a_small_picture_is_enlarged(size):
    def slope(rows, columns):
        down, across = np.mgrid[0:rows, 0:columns]
        return GradientFeatures().extract(frame_of(127.5 * (down / rows + across / columns)))

    small, full = slope(*size), slope(120, 160)
    assert small.shape == full.shape
    assert size == (1, 1) or np.corrcoef(small[384:], full[384:])[0, 1] > 0.98


def test_an_edge_is_recognised_in_the_neighbouring_cell():
    """Two views that differ in only one cell; then the same views, shifted sideways by one cell."""

    def view(column, is_left):
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
