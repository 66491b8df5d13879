"""Writes pictures as PNG files, with zlib only, for pages and other programs."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray


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
    filtered = np.zeros((height, rows.shape[1] + 1), np.uint8)  # a first byte 0 means no filter
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
