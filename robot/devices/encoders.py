"""Encodes pictures for pages and other programs: as JPEG, or as PNG (which needs only zlib)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import need
from robot.policy.image import Pixels, swap_red_and_blue


def encode_png(picture: NDArray[Any], *, level: int = 6) -> bytes:
    """Return a PNG file of a picture, shape (height, width) or (height, width, 3), uint8; raises
    ValueError for any other shape or type."""
    if (
        picture.dtype != np.uint8
        or picture.ndim not in (2, 3)
        or picture.shape[2:] not in ((), (3,))
    ):
        raise ValueError(f"not a picture: shape {picture.shape}, {picture.dtype}")
    height, width = picture.shape[:2]
    rows = picture.reshape(height, -1)
    filtered = np.zeros((height, rows.shape[1] + 1), np.uint8)  # byte 0 of a row is 0: no filter
    filtered[:, 1:] = rows
    colour_type = 0 if picture.ndim == 2 else 2
    header = struct.pack(">IIBBBBB", width, height, 8, colour_type, 0, 0, 0)
    return b"".join(
        (
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", header),
            _chunk(b"IDAT", zlib.compress(filtered.tobytes(), level)),
            _chunk(b"IEND", b""),
        )
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def jpeg_encoder(
    quality: int, feature: str = "JPEG from a camera of another format"
) -> Callable[[Pixels], bytes]:
    """Return a function that encodes pixels, shape (height, width, 3), red first, as JPEG.

    The function uses the standard Huffman tables: optimised tables would save 12 % of the bytes but
    double the time.

    Raises:
        MissingExtraError: If OpenCV is not installed.
    """
    cv2 = need("cv2", feature, "camera")
    options = [cv2.IMWRITE_JPEG_QUALITY, quality]

    def encode(rgb: Pixels) -> bytes:
        _, jpeg = cv2.imencode(".jpg", swap_red_and_blue(rgb), options)
        return bytes(jpeg)

    return encode
