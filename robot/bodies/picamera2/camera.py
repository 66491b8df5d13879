"""A Raspberry Pi's camera module, by the library picamera2 of Raspberry Pi OS."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from importlib import import_module
from typing import Any, ClassVar

from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devkit.threaded_camera import WatchedCamera
from robot.errors import CameraError, told_as
from robot.types import Encoding

_OLDEST_S = 2.0
"""Maximum age of a picture by its time stamp, in seconds. If the time stamp is older, it is
replaced by the time at which the picture arrived."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Picamera2Options(Options):
    """The requested picture."""

    width: int = option(160, "width of the picture in pixels", range=(32, 1920))
    height: int = option(120, "height of the picture in pixels", range=(24, 1920))
    frame_rate: int = option(30, "pictures a second", range=(1, 120))
    camera_number: int = option(0, "number of the camera module; the first is 0", range=(0, 7))
    upside_down: bool = option(False, "obsolete; use --turn-picture 180 instead")


class Picamera2Camera(WatchedCamera):
    """Takes pictures on the library's thread; a second thread checks that they keep arriving.

    The time of a picture is the time at which the sensor exposed it.
    """

    name: ClassVar[str] = "picamera2"
    options_type: ClassVar[type[Any]] = Picamera2Options

    def __init__(self, options: Picamera2Options, clock: Clock, library: Any = None) -> None:
        super().__init__(options, clock)
        self._library = library
        self._device: Any = None

    def _begin(self) -> None:
        options = self.options
        do = "sudo apt install python3-picamera2, and an environment with --system-site-packages"
        with told_as(CameraError, "there is no picamera2 for this Python", ImportError, do=do):
            library = self._library or import_module("picamera2")
        n_cameras = len(library.Picamera2.global_camera_info())
        if options.camera_number >= n_cameras:
            raise CameraError(
                f"there is no camera module {options.camera_number} ({n_cameras} found); check its "
                "ribbon cable, and `rpicam-hello --list-cameras`"
            )
        module = f"the camera module {options.camera_number}"
        wrong = f"{module} cannot be opened"
        # The library has no error classes of its own, so every error is caught.
        with told_as(CameraError, wrong, Exception, do="does another program use it?"):
            self._device = device = library.Picamera2(options.camera_number)
        asked = f"{options.width}x{options.height} at {options.frame_rate} a second"
        with told_as(CameraError, f"{module} refuses {asked}", Exception):
            device.configure(
                device.create_video_configuration(
                    # The library names formats backwards: the bytes are red, green and blue.
                    main={"size": (options.width, options.height), "format": "BGR888"},
                    controls={"FrameRate": options.frame_rate},
                    buffer_count=3,
                )
            )
            device.pre_callback = self._take
            device.start()
        self._watch_over()

    def _let_go(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            device.pre_callback = None
            with contextlib.suppress(Exception):
                device.stop()
            device.close()

    def _take(self, request: Any) -> None:
        """Take one picture, on the library's thread."""
        picture = request.make_array("main")
        if self.options.upside_down:
            picture = picture[::-1, ::-1]
        data = picture.tobytes()
        now_s = self.clock.now_s()
        if not self._freshness.is_new(data, now_s):
            return
        stamp_ns = request.get_metadata().get("SensorTimestamp")
        exposed_s = now_s if stamp_ns is None else self._on_clock(stamp_ns / 1e9)
        self._publish(
            data,
            width=picture.shape[1],
            height=picture.shape[0],
            encoding=Encoding.RGB,
            captured_s=exposed_s if 0 <= now_s - exposed_s <= _OLDEST_S else now_s,
        )

    def _name_fault(self, wrong: str) -> str:
        return f"The camera module {wrong}; check its ribbon cable."
