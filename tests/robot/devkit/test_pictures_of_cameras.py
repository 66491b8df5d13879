"""Pictures as people's cameras send them: huge, lossless, or always the same."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest

from robot.bodies.mjpeg.camera import MjpegCamera, MjpegOptions
from robot.devkit.pictures import DRIVEN_BY_PX, check_kind, read_jpeg, reduce_picture
from robot.errors import RecordingError
from robot.testing import VirtualClock


def jpeg(width: int, height: int) -> bytes:
    ramp = np.linspace(0, 255, width, dtype=np.uint8)
    pixels = np.repeat(np.tile(ramp, (height, 1))[:, :, None], 3, axis=2)
    return cv2.imencode(".jpg", pixels)[1].tobytes()


@pytest.mark.parametrize("size", [(4000, 3000), (4096, 2160), (3000, 4000), (1281, 960)])
def test_a_picture_of_many_megapixels_is_passed_on_smaller(size: tuple[int, int]) -> None:
    big = read_jpeg(jpeg(*size))
    small = reduce_picture(big)
    assert small.width * small.height <= DRIVEN_BY_PX
    assert small.width / small.height == pytest.approx(size[0] / size[1], rel=0.02)
    assert read_jpeg(small.data).width == small.width
    pixels = cv2.imdecode(np.frombuffer(small.data, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert pixels[:, 2].mean() < 30 < 220 < pixels[:, -3].mean()


def test_a_picture_that_is_small_enough_keeps_its_bytes() -> None:
    usual = read_jpeg(jpeg(640, 480))
    assert reduce_picture(usual) is usual


def test_a_lossless_jpeg_is_reported_once_and_not_with_each_picture() -> None:
    usual = jpeg(64, 48)
    check_kind(usual)
    lossless = usual.replace(b"\xff\xc0", b"\xff\xc3", 1)
    with pytest.raises(RecordingError, match=r"lossless JPEGs.*choose baseline JPEG"):
        check_kind(lossless)
    check_kind(b"\xff\xd8\xff\xe0" + struct.pack(">H", 9))  # cut in its first part
    camera = MjpegCamera(MjpegOptions(source="http://192.0.2.1/"), VirtualClock())
    said = set()
    for _ in range(3):
        camera._take(lossless, 0.0)
        said.add(camera._name_fault("gives no pictures"))
    assert len(said) == 1 and "lossless" in said.pop()


def test_an_earlier_fault_of_a_camera_is_not_reported_after_it_is_back() -> None:
    """The camera's server was restarted, and repeats its earlier picture."""
    camera = MjpegCamera(MjpegOptions(source="http://192.0.2.1/"), VirtualClock())
    camera._take(jpeg(64, 48), 0.0)
    camera._reason = "it has answered and sends nothing"
    camera._take(jpeg(64, 48), 1.0)
    assert camera._name_fault("repeats one picture").endswith("repeats one picture; restart it.")
    camera._reason = "the stream ended"
    assert camera._name_fault("repeats one picture").endswith("no pictures (the stream ended).")
