"""Frames to arrays. Only JPEG needs OpenCV; what an EV3's camera gives needs numpy alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import CameraError, MissingExtraError
from robot.types import Encoding, Frame

Picture = NDArray[np.uint8]


def to_rgb(frame: Frame) -> Picture:
    """Return the frame's pixels, shape (height, width, 3), uint8.

    Raises:
        CameraError: If the bytes are no picture of this size.
        MissingExtraError: If it is a JPEG and OpenCV is not installed.
    """
    if frame.encoding is Encoding.JPEG:
        cv2 = _import_cv2()
        bgr = cv2.imdecode(np.frombuffer(frame.data, np.uint8), cv2.IMREAD_COLOR)
        if bgr is None:
            raise CameraError(f"frame {frame.frame_id} is no JPEG picture")
        return np.ascontiguousarray(bgr[:, :, ::-1])
    if frame.encoding is Encoding.RGB:
        return _reshape(frame, 3)
    yuyv = _reshape(frame, 2).astype(np.float32)
    y, u, v = (
        yuyv[:, :, 0],
        yuyv[:, 0::2, 1].repeat(2, 1) - 128,
        yuyv[:, 1::2, 1].repeat(2, 1) - 128,
    )
    rgb = np.stack((y + 1.402 * v, y - 0.344 * u - 0.714 * v, y + 1.772 * u), axis=2)
    return rgb.round().clip(0, 255).astype(np.uint8)


def to_grey(frame: Frame) -> Picture:
    """Return the frame's brightness, shape (height, width), uint8; raises as `to_rgb`."""
    if frame.encoding is Encoding.YUYV:
        return _reshape(frame, 2)[:, :, 0]
    rgb = to_rgb(frame).astype(np.uint16)
    return ((77 * rgb[:, :, 0] + 150 * rgb[:, :, 1] + 29 * rgb[:, :, 2]) >> 8).astype(np.uint8)


def _reshape(frame: Frame, channels: int) -> Picture:
    expected = frame.height * frame.width * channels
    if len(frame.data) != expected:
        raise CameraError(
            f"frame {frame.frame_id} has {len(frame.data)} bytes; "
            f"{frame.width}x{frame.height} {frame.encoding} needs {expected}"
        )
    return np.frombuffer(frame.data, np.uint8).reshape(frame.height, frame.width, channels)


def _import_cv2() -> Any:
    try:
        import cv2
    except ImportError as error:
        raise MissingExtraError("reading JPEG pictures", "camera") from error
    return cv2
