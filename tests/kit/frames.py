"""Frames for tests of what stores and sends them."""

from __future__ import annotations

from robot.types import Encoding, Frame


def jpeg_frame(frame_id: int, captured_s: float, data: bytes, width: int = 160) -> Frame:
    """Return a frame of the size of the cameras; the bytes need not be a picture."""
    return Frame(
        frame_id=frame_id,
        captured_s=captured_s,
        width=width,
        height=120,
        encoding=Encoding.JPEG,
        data=data,
    )
