"""Converts frames of all encodings to arrays of colour or grey pixels."""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from robot.errors import CameraError, need
from robot.types import Encoding, Frame

Pixels = NDArray[np.uint8]


def to_rgb(frame: Frame) -> Pixels:
    """Return the frame's pixels, shape (height, width, 3).

    Raises:
        CameraError: If the bytes are not an image of the frame's size.
        MissingExtraError: If the frame is a JPEG and OpenCV is not installed.
    """
    if frame.encoding is Encoding.JPEG:
        return swap_red_and_blue(_decode_jpeg(frame, colour=True))
    if frame.encoding is Encoding.RGB:
        return _packed(frame, 3)
    return _yuyv_to_rgb(_packed(frame, 2))


def to_grey(frame: Frame) -> Pixels:
    """Return the frame's brightness, shape (height, width); raises the errors of `to_rgb`."""
    if frame.encoding is Encoding.JPEG:
        return _decode_jpeg(frame, colour=False)
    if frame.encoding is Encoding.YUYV:
        return _packed(frame, 2)[:, :, 0]
    return rgb_to_grey(_packed(frame, 3))


def to_small_grey(frame: Frame, width: int, height: int) -> Pixels:
    """Return the frame in grey, reduced to shape (height, width); raises the errors of `to_rgb`.

    The function averages colours before it converts them to grey.
    """
    if frame.encoding is Encoding.YUYV:
        return shrink(to_grey(frame), width, height)
    return rgb_to_grey(shrink(to_rgb(frame), width, height))


def rgb_to_grey(rgb: Pixels) -> Pixels:
    """Return the brightness of pixels, shape (height, width)."""
    # ITU-R BT.601 with 16 fractional bits: integers only, for machines without an FPU.
    sums = np.full(rgb.shape[:2], 32768, np.uint32)
    part = np.empty_like(sums)
    for channel, weight in enumerate((19595, 38470, 7471)):
        sums += np.multiply(rgb[:, :, channel], np.uint32(weight), out=part, dtype=np.uint32)
    sums >>= 16
    return sums.astype(np.uint8)


def shrink(pixels: Pixels, width: int, height: int) -> Pixels:
    """Return the mean of each area, rounded to nearest, shape (height, width[, 3]).

    The function first enlarges a picture that has fewer pixels.
    """
    pixels = enlarge(pixels, width, height)
    rows, columns = pixels.shape[:2]
    for halvings in (1, 2):
        if (rows, columns) == (height << halvings, width << halvings):
            return _shrink_by_halves(pixels, halvings)
    top, left = (np.arange(n) * full // n for n, full in ((height, rows), (width, columns)))
    sums = np.add.reduceat(pixels, top, axis=0, dtype=np.int32)
    sums = np.add.reduceat(sums, left, axis=1)
    areas = np.outer(np.diff(top, append=rows), np.diff(left, append=columns))
    areas = areas.reshape(areas.shape + (1,) * (pixels.ndim - 2))
    means, rests = np.divmod(2 * sums + areas, 2 * areas)
    means -= (rests == 0) & (means % 2 == 1)  # round half to even
    small: Pixels = means.astype(np.uint8)
    return small


def enlarge(pixels: Pixels, width: int, height: int) -> Pixels:
    """Return the picture, interpolated to at least this width and height."""
    for axis, length in ((0, height), (1, width)):
        if pixels.shape[axis] < length:
            pixels = _stretched(pixels, axis, length)
    return pixels


def at_common_scale(pixels: Pixels, width: int, height: int) -> Pixels:
    """Scale the picture so that each side is one to two times the given length. The same detail
    then has a similar size in the pictures of different cameras."""
    pixels = enlarge(pixels, width, height)
    rows, columns = (
        side if length >= 2 * side else length
        for length, side in zip(pixels.shape[:2], (height, width), strict=True)
    )
    return pixels if pixels.shape[:2] == (rows, columns) else shrink(pixels, columns, rows)


def _stretched(pixels: Pixels, axis: int, length: int) -> Pixels:
    """Interpolate between the centres of pixels, in integers."""
    old = pixels.shape[axis]
    places = (2 * np.arange(length) + 1) * old * 128 // length - 128  # in units of 1/256 pixel
    places = places.clip(0, (old - 1) * 256)
    first = (places >> 8).astype(np.intp)
    shape = [1] * pixels.ndim
    shape[axis] = length
    share = (places & 255).reshape(shape)
    one = pixels.take(first, axis=axis).astype(np.int32)
    other = pixels.take(np.minimum(first + 1, old - 1), axis=axis)
    between: Pixels = (one + ((other - one) * share + 128 >> 8)).astype(np.uint8)
    return between


def _shrink_by_halves(pixels: Pixels, halvings: int) -> Pixels:
    """Shrink both sides by 2 or 4 like `shrink`, in a sixth of the time, by adding whole slices.

    Rows are added first, because they are contiguous in memory for any number of channels.
    """
    step = 1 << halvings
    blocks = pixels.reshape(-1, step, *pixels.shape[1:])
    lines = blocks.sum(axis=1, dtype=np.uint16)
    sums = lines[:, 0::step] + lines[:, 1::step]
    for column in range(2, step):
        sums += lines[:, column::step]
    # Round half to even: before the shift, add a half minus 1, and 1 more if the quotient is odd.
    bits = 2 * halvings
    sums += (1 << bits - 1) - 1 + (sums >> bits & 1)
    small: Pixels = (sums >> bits).astype(np.uint8)
    return small


def _packed(frame: Frame, n_channels: int) -> Pixels:
    expected = frame.width * frame.height * n_channels
    if len(frame.data) != expected or expected == 0:
        raise CameraError(
            f"a picture in {frame.encoding.upper()} of {frame.width}x{frame.height} must have "
            f"{expected} bytes, not {len(frame.data)}; check the camera's format"
        )
    flat = np.frombuffer(frame.data, np.uint8)
    return flat.reshape(frame.height, frame.width, n_channels)


def _decode_jpeg(frame: Frame, *, colour: bool) -> Pixels:
    pixels = decode(frame.data, colour=colour)
    if pixels is None:
        raise CameraError(
            "the camera's pictures cannot be read as JPEG; choose another format in its settings"
        )
    return pixels


def decode(data: bytes, *, colour: bool = True) -> Pixels | None:
    """Decode a JPEG or PNG to blue, green and red, or to grey; return None if it is neither.

    Raises:
        MissingExtraError: If OpenCV is not installed.
    """
    cv2 = sys.modules.get("cv2") or need("cv2", "reading pictures", "camera")
    flag = cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE
    try:
        decoded: Pixels | None = cv2.imdecode(np.frombuffer(data, np.uint8), flag) if data else None
    except cv2.error:
        return None
    return decoded


def swap_red_and_blue(pixels: Pixels) -> Pixels:
    """Return a copy with red and blue swapped, because OpenCV expects blue first."""
    cv2 = need("cv2", "reading pictures", "camera")
    swapped: Pixels = cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR)
    return swapped


def _yuyv_to_rgb(yuyv: Pixels) -> Pixels:
    if yuyv.shape[1] % 2:
        raise CameraError(f"a YUYV picture must have an even width, not {yuyv.shape[1]}")
    luma = yuyv[:, :, 0].astype(np.int32) << 16
    u = np.repeat(yuyv[:, 0::2, 1].astype(np.int32), 2, axis=1) - 128
    v = np.repeat(yuyv[:, 1::2, 1].astype(np.int32), 2, axis=1) - 128
    red, green, blue = luma + 91881 * v, luma - 22554 * u - 46802 * v, luma + 116130 * u
    rgb = np.stack([red, green, blue], axis=2) + 32768 >> 16
    return rgb.clip(0, 255).astype(np.uint8)
