"""Checks pictures from other programs before use; JPEG bytes stay unchanged."""

from __future__ import annotations

import io
import re
import struct
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from robot.errors import RecordingError, need
from robot.policy.image import Pixels, decode, swap_red_and_blue
from robot.types import Encoding

MAX_SIDE_PX = 4096
DRIVEN_BY_PX = 1280 * 960
"""Maximum number of pixels of a picture that is passed on unchanged. Larger pictures would reach
the pilot later, and the learner uses only a few hundred pixels."""
_SHARES = (2, 4, 8)
"""Factors by which a decoder can reduce the width and height of a JPEG. Decoding to a reduced size
takes a fraction of the time of decoding to full size."""
_READABLE_SOF = (0xC0, 0xC1, 0xC2)
"""Kinds of JPEG that decoders read: baseline, extended and progressive, but not the lossless kind
0xC3."""
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG, _SCAN = b"\xff\xd8\xff", b"\xff\xda"
_MARKER = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]", re.DOTALL)
"""Matches the marker after a scan. Within a scan, 0x00 or a restart marker follows each 0xFF."""
_HEAD_BYTES = 4096
"""The first scan of a JPEG usually starts within this many bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One picture: the unchanged bytes of a JPEG, or the pixels of a PNG as RGB."""

    encoding: Encoding
    width: int
    height: int
    data: bytes = field(repr=False)

    @property
    def is_too_large(self) -> bool:
        """True if the width or height is above 4096 pixels."""
        return max(self.width, self.height) > MAX_SIDE_PX


def read_picture(data: bytes, name: str) -> Picture:
    """Check the bytes of a JPEG or PNG by decoding them once.

    Raises:
        RecordingError: If the bytes are not a picture, or if the picture is damaged, or wider or
            higher than 4096 pixels.
        MissingExtraError: If OpenCV is not installed.
    """
    size = _size(data)
    if size is None:
        raise RecordingError(f"{name} is not a picture (JPEG or PNG)")
    width, height = size
    if not (0 < width <= MAX_SIDE_PX and 0 < height <= MAX_SIDE_PX):
        raise RecordingError(
            f"{name} has {width}x{height} pixels, but each side may have at most {MAX_SIDE_PX}"
        )
    if not _has_end(data):
        raise RecordingError(f"{name} is a damaged picture: its end is missing")
    if data.startswith(_JPEG):
        # Decoding to a reduced size reads all bytes, but takes only a fifth of the time.
        small = _decode_reduced(data, "GRAYSCALE_8")
        if small is None or small.shape != (-(-height // 8), -(-width // 8)):
            raise RecordingError(f"{name} is a damaged picture")
        return Picture(encoding=Encoding.JPEG, width=width, height=height, data=data)
    pixels = decode(data)
    # the decoder rotates a PNG according to its Exif data
    if pixels is None or pixels.shape not in ((height, width, 3), (width, height, 3)):
        raise RecordingError(f"{name} is a damaged picture")
    height, width = pixels.shape[:2]
    rgb = swap_red_and_blue(pixels)
    return Picture(encoding=Encoding.RGB, width=width, height=height, data=rgb.tobytes())


def _decode_reduced(data: bytes, how: str) -> Pixels | None:
    """Decode a JPEG at a part of its width and height, rounded up; None if it cannot be decoded.

    `how` is the suffix of the name of an OpenCV flag: `GRAYSCALE_8` means grey, and an
    eighth of the size.
    """
    cv2 = need("cv2", "reading pictures", "camera")
    flag = getattr(cv2, f"IMREAD_REDUCED_{how}")
    try:
        pixels: Pixels | None = cv2.imdecode(np.frombuffer(data, np.uint8), flag)
    except cv2.error:
        return None
    return pixels


def _size(data: bytes) -> tuple[int, int] | None:
    """Read width and height from the header, without decoding the picture."""
    head = data[:_HEAD_BYTES]
    end = head.find(_SCAN)
    known = _size_in(head[:end]) if end > 0 else None
    return known or _size_in.__wrapped__(data)


@lru_cache(maxsize=16)
def _size_in(data: bytes) -> tuple[int, int] | None:
    """Read width and height. Cached, because a camera's pictures all have the same header."""
    if not data.startswith((_PNG, _JPEG)):
        return None
    imagesize = need("imagesize", "reading pictures", "camera")
    try:
        width, height = imagesize.get(io.BytesIO(data))
    except (ValueError, struct.error):
        return None
    return (int(width), int(height)) if width > 0 and height > 0 else None


def read_jpeg(data: bytes) -> Picture:
    """Return a JPEG without changing its bytes; width and height are those in its header. Raises
    RecordingError if `data` is not a JPEG."""
    size = _size(data) if data.startswith(_JPEG) else None
    if size is None:
        raise RecordingError("not a JPEG")
    return Picture(encoding=Encoding.JPEG, width=size[0], height=size[1], data=data)


def check_kind(data: bytes) -> None:
    """Raise RecordingError for a kind of JPEG that common decoders do not read, such as lossless
    JPEG."""
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            if marker not in _READABLE_SOF:
                kind = "lossless" if marker in (0xC3, 0xC7, 0xCB, 0xCF) else "hierarchical"
                raise RecordingError(
                    f"its pictures are {kind} JPEGs, which browsers and decoders do not read; "
                    "choose baseline JPEG in its settings"
                )
            return
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")


def reduce_picture(picture: Picture, quality: int = 80) -> Picture:
    """Reduce a JPEG above `DRIVEN_BY_PX`; return other pictures unchanged.

    Raises:
        RecordingError: If the picture cannot be decoded.
        MissingExtraError: If OpenCV is not installed.
    """
    if picture.encoding is not Encoding.JPEG or picture.width * picture.height <= DRIVEN_BY_PX:
        return picture
    cv2 = need("cv2", "reading pictures", "camera")
    n_pixels = picture.width * picture.height
    share = next((one for one in _SHARES if n_pixels <= DRIVEN_BY_PX * one * one), _SHARES[-1])
    pixels = _decode_reduced(picture.data, f"COLOR_{share}")
    if pixels is None:
        raise RecordingError("the camera's pictures cannot be read as JPEG")
    _, small = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    height, width = pixels.shape[:2]
    return Picture(encoding=Encoding.JPEG, width=width, height=height, data=small.tobytes())


def _has_end(data: bytes) -> bool:
    """True if a picture is complete. Decoders silently fill up a truncated picture with grey."""
    if data.startswith(_PNG):
        return b"IEND" in data
    # a complete JPEG has its end marker after the start of its last scan
    return data.rfind(b"\xff\xd9") > data.rfind(_SCAN) or _ends_early(data)


def _ends_early(data: bytes) -> bool:
    """True if a JPEG is complete, but followed by other bytes that look like a scan: for example,
    phones append a short film to a picture."""
    at = 2
    while data[at : at + 1] == b"\xff" and data[at : at + 2] != b"\xff\xd9":
        is_scan = data[at : at + 2] == _SCAN
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        if is_scan and (found := _MARKER.search(data, at)):
            at = found.start()
    return data[at : at + 2] == b"\xff\xd9"
