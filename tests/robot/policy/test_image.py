from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot.devices.encoders import jpeg_encoder
from robot.errors import CameraError
from robot.policy import image
from robot.types import Encoding
from tests.kit.frames import make_frame
from tests.kit.sizes import crossed


def frame(data, encoding):
    return make_frame(data, encoding, width=16, height=12)


@pytest.fixture
def smooth():
    ramp = np.linspace(20, 220, 16)[None, :] + np.linspace(0, 30, 12)[:, None]
    return np.stack([ramp, ramp[:, ::-1], np.full((12, 16), 90)], axis=2).astype(np.uint8)


def test_grey_is_the_same_from_rgb_and_jpeg(smooth):
    _, jpeg = cv2.imencode(".jpg", smooth[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 100])
    plain = image.to_grey(frame(smooth.tobytes(), Encoding.RGB))
    packed = image.to_grey(frame(jpeg.tobytes(), Encoding.JPEG))
    assert np.abs(plain.astype(int) - packed.astype(int)).max() <= 3
    assert np.abs(plain.astype(int) - cv2.cvtColor(smooth, cv2.COLOR_RGB2GRAY)).max() <= 1


def test_yuyv_to_rgb_agrees_with_opencv():
    rng = np.random.default_rng(1)
    yuyv = rng.integers(60, 190, (12, 16, 2)).astype(np.uint8)
    ours = image.to_rgb(frame(yuyv.tobytes(), Encoding.YUYV))
    v, u = np.repeat(yuyv[:, 1::2, 1], 2, axis=1), np.repeat(yuyv[:, 0::2, 1], 2, axis=1)
    theirs = cv2.cvtColor(np.stack([yuyv[:, :, 0], v, u], axis=2), cv2.COLOR_YCrCb2RGB)
    assert np.abs(ours.astype(int) - theirs.astype(int)).max() <= 2
    assert np.array_equal(image.to_grey(frame(yuyv.tobytes(), Encoding.YUYV)), yuyv[:, :, 0])


@crossed(encoding=list(Encoding), data=[b"", b"not an image"])
def test_invalid_image_bytes_are_a_camera_error(encoding, data):
    for convert in (image.to_grey, image.to_rgb):
        with pytest.raises(CameraError):
            convert(frame(data, encoding))


def test_shrinking_averages_areas():
    grey = np.arange(24 * 32, dtype=np.uint32).reshape(24, 32) % 251
    small = image.shrink(grey.astype(np.uint8), 8, 6)
    exact = grey.reshape(6, 4, 8, 4).mean(axis=(1, 3))
    assert np.abs(small - exact).max() <= 0.5
    assert image.shrink(grey.astype(np.uint8), 7, 5).shape == (5, 7)


@pytest.mark.parametrize("times", [2, 4])
def test_the_fast_shrink_rounds_halves_to_even_too(times):
    rng = np.random.default_rng(2)
    grey = rng.integers(0, 256, (30 * times, 40 * times), dtype=np.uint8)
    exact = np.rint(grey.reshape(30, times, 40, times).mean(axis=(1, 3)))
    assert np.array_equal(image.shrink(grey, 40, 30), exact)
    colour = np.repeat(grey[:, :, None], 3, axis=2)
    assert np.array_equal(image.shrink(colour, 40, 30)[:, :, 1], exact)


def test_jpeg_with_standard_tables_equals_one_with_its_own_tables_to_the_pixel(smooth):
    options = [cv2.IMWRITE_JPEG_QUALITY, 75, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    _, optimised = cv2.imencode(".jpg", np.ascontiguousarray(smooth[:, :, ::-1]), options)

    plain = jpeg_encoder(75)(smooth)

    assert np.array_equal(image.decode(plain), image.decode(optimised.tobytes()))
