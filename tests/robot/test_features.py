from __future__ import annotations

import numpy as np
import pytest

from robot.features import GradientFeatures, GreyFeatures
from robot.types import Encoding, Frame


def picture(pixels):
    height, width = pixels.shape[:2]
    rgb = np.repeat(pixels[:, :, None], 3, axis=2).astype(np.uint8)
    return Frame(
        frame_id=1,
        captured_s=0.0,
        width=width,
        height=height,
        encoding=Encoding.RGB,
        data=rgb.tobytes(),
    )


@pytest.fixture
def room():
    rng = np.random.default_rng(3)
    coarse = rng.integers(0, 255, (12, 16))
    return np.kron(coarse, np.ones((10, 10)))


@pytest.mark.parametrize("features", [GreyFeatures(), GradientFeatures()], ids=lambda f: f.name)
def test_vector_is_finite_pure_and_shows_its_thumbnail(features, room):
    x = features.extract(picture(room))
    assert x.ndim == 1
    assert np.isfinite(x).all()
    assert np.array_equal(x, features.extract(picture(room)))
    grey = GreyFeatures().extract(picture(room)).reshape(30, 40)
    assert np.abs(features.thumbnail(x).astype(int) - grey).max() <= 1


def test_gradients_stay_when_the_light_changes(room):
    features = GradientFeatures(grey_weight=0.01)
    bright, dim = (features.extract(picture(room * scale)) for scale in (1.0, 0.6))
    other = features.extract(picture(room[:, ::-1]))
    assert np.linalg.norm(bright - dim) < 0.2 * np.linalg.norm(bright - other)


def test_a_plain_frame_has_no_gradients():
    features = GradientFeatures()
    assert not features.extract(picture(np.full((120, 160), 77.0)))[:384].any()
