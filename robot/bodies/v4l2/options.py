"""What a person may choose of a USB camera, on this machine or on a brick."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbCameraOptions:
    """Which camera, and what is asked of it; it answers with the nearest that it has."""

    device: str = field(
        default="auto", metadata={"help": "the camera, as /dev/video0; auto takes the first"}
    )
    width: int = field(
        default=160, metadata={"help": "width of the picture in pixels", "range": (40, 3840)}
    )
    height: int = field(
        default=120, metadata={"help": "height of the picture in pixels", "range": (30, 2160)}
    )
    frame_rate: int = field(default=30, metadata={"help": "pictures a second", "range": (1, 120)})
    encoding: str = field(
        default="auto",
        metadata={
            "help": "what the camera sends; auto takes yuyv where it is offered",
            "choices": ("auto", "yuyv", "jpeg"),
        },
    )
