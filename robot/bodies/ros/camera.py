"""A ROS topic of compressed images, by rosbridge. The JPEGs stay as they are."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.ros.bridge import RosBridge
from robot.bodies.ros.driver import check_topic
from robot.bodies.ros.refusals import advice_for
from robot.devices.options import Options, option
from robot.devkit.pictures import read_jpeg
from robot.devkit.watched_camera import WatchedCamera
from robot.errors import CameraError, DriveError, RecordingError, need

_IMAGE = "sensor_msgs/msg/CompressedImage"


@dataclass(frozen=True, slots=True, kw_only=True)
class RosCameraOptions(Options):
    """Where the pictures come from."""

    address: str = option("", "HOST of rosbridge, or HOST:PORT")
    image_topic: str = option(
        "/camera/image_raw/compressed", "topic of the pictures (sensor_msgs/CompressedImage, JPEG)"
    )

    def check(self) -> None:
        check_topic("--image-topic", self.image_topic)


class RosCamera(WatchedCamera):
    """Takes the newest picture of a topic; a thread watches the time.

    A picture is stamped when it came: the robot's clock is another one.
    """

    name: ClassVar[str] = "ros"
    options_type: ClassVar[type[Any]] = RosCameraOptions
    _bridge: RosBridge | None = None
    _reason = ""

    def _begin(self) -> None:
        need("cv2", "the camera 'ros'", "camera")
        try:
            self._bridge = RosBridge(
                self.options.address,
                self.clock,
                advertised={},
                subscribed={self.options.image_topic: _IMAGE},
                on_message=lambda _, message: self._take(message),
            )
        except DriveError as error:
            raise CameraError(str(error)) from error
        self._watch_over()

    def _let_go(self) -> None:
        bridge, self._bridge = self._bridge, None
        if bridge is not None:
            bridge.close()

    def _take(self, message: Mapping[str, Any]) -> None:
        """Take one image, on the bridge's thread."""
        now_s = self.clock.now_s()
        try:
            picture = read_jpeg(base64.b64decode(message["data"], validate=True))
        except (KeyError, TypeError, ValueError, binascii.Error, RecordingError):
            self._reason = f" (it sends {str(message.get('format', 'something'))[:20]!r}, no JPEG)"
            return
        if picture.is_too_large:
            self._reason = f" (its pictures are {picture.width}x{picture.height}: too large)"
        elif self._freshness.is_new(picture.data, now_s):
            self._reason = ""
            self._show_picture(picture, now_s)

    def _name_fault(self, wrong: str) -> str:
        if self._bridge is not None and (refusal := self._bridge.refusal):
            do = advice_for(refusal, is_stamped=False, has_watchdog=False)
            said = f"rosbridge at {self.options.address} refuses: {refusal}"
            return said + (f"; {do}" if do else "") + "."
        return f"The topic {self.options.image_topic} {wrong}{self._reason}."
