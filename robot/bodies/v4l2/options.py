"""What a person may choose of a USB camera, on this machine or on a brick."""

from __future__ import annotations

from dataclasses import dataclass

from robot.devices.options import Options, option


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbCameraOptions(Options):
    """Which camera, and what is asked of it; it answers with the nearest that it has."""

    device: str = option("auto", "the camera, as /dev/video0; auto takes the first")
    width: int = option(160, "width of the picture in pixels", range=(40, 3840))
    height: int = option(120, "height of the picture in pixels", range=(30, 2160))
    frame_rate: int = option(30, "pictures a second", range=(1, 120))
    encoding: str = option(
        "auto",
        "what the camera sends; auto takes yuyv where it is offered",
        choices=("auto", "yuyv", "jpeg"),
    )
