"""A camera that is a ROS topic of images, by rosbridge or DDS. JPEGs are not re-encoded."""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from robot.bodies.ros.refusals import advice_for
from robot.bodies.ros.topics import COMPRESSED, RAW, Message, Topics, check_topic
from robot.bodies.ros.transport import TransportOptions, open_topics
from robot.devices.options import option
from robot.devkit.pictures import MAX_SIDE_PX, Picture, read_jpeg
from robot.devkit.threaded_camera import WatchedCamera
from robot.errors import CameraError, DriveError, RecordingError, need
from robot.types import Encoding

_KINDS = {"compressed": COMPRESSED, "raw": RAW}
_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1, "8UC3": 3, "8UC1": 1}
"""Bytes per pixel of sensor_msgs/Image's encodings, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RosCameraOptions(TransportOptions):
    """The source of the pictures."""

    image_topic: str = option("/camera/image_raw/compressed", "topic of the pictures")
    image_type: str = option(
        "compressed",
        "message type of the pictures: compressed is sensor_msgs/CompressedImage (JPEG), raw is "
        "sensor_msgs/Image",
        choices=tuple(_KINDS),
    )

    def check(self) -> None:
        self.check_transport()
        check_topic("--image-topic", self.image_topic)


class RosCamera(WatchedCamera):
    """A camera that delivers the newest picture of a topic, while a thread checks that pictures
    keep coming.

    The time of a picture is the time of its arrival, because the robot has another clock.
    """

    name: ClassVar[str] = "ros"
    options_type: ClassVar[type[Any]] = RosCameraOptions
    _topics: Topics | None = None
    _reason = ""

    def _begin(self) -> None:
        need("cv2", "the camera 'ros'", "camera")
        kind = _KINDS[self.options.image_type]
        try:
            self._topics = open_topics(
                self.options,
                self.clock,
                advertised={},
                subscribed={self.options.image_topic: kind},
                on_message=lambda _, message: self._take(message),
            )
        except DriveError as error:
            raise CameraError(str(error)) from error
        self._watch_over()

    def _let_go(self) -> None:
        topics, self._topics = self._topics, None
        if topics is not None:
            topics.close()

    @property
    def _is_raw(self) -> bool:
        return bool(self.options.image_type == "raw")

    def _take(self, message: Message) -> None:
        """Receive one image, on the connection's thread."""
        now_s = self.clock.now_s()
        try:
            data = message["data"]
            if not isinstance(data, bytes):  # rosbridge sends the data as Base64 text
                data = base64.b64decode(data, validate=True)
            picture = read_pixels(message, data) if self._is_raw else read_jpeg(data)
        except (KeyError, TypeError, ValueError, binascii.Error, RecordingError):
            form = str(message.get("encoding", message.get("format", "something")))[:20]
            what = "of an unsupported size or encoding" if self._is_raw else "which is not JPEG"
            self._reason = f" (it sends {form!r}, {what})"
            return
        if picture.is_too_large:
            self._reason = f" (pictures of {picture.width}x{picture.height} are too large)"
        elif self._freshness.is_new(picture.data, now_s):
            self._reason = ""
            self._show_picture(picture, now_s)

    def _name_fault(self, wrong: str) -> str:
        if self._topics is not None and (refusal := self._topics.refusal):
            do = advice_for(refusal, is_stamped=False, has_watchdog=False)
            return self._topics.refused(refusal) + (f"; {do}" if do else "") + "."
        return f"The topic {self.options.image_topic} {wrong}{self._reason}."


def read_pixels(message: Message, data: bytes) -> Picture:
    """Return the pixels of a sensor_msgs/Image as RGB.

    Raises:
        ValueError: If the encoding is not grey or colour of eight bits, or the length is wrong.
    """
    width, height, step = (int(message[name]) for name in ("width", "height", "step"))
    encoding = str(message["encoding"])
    channels = _CHANNELS[encoding]
    if not 0 < min(width, height) <= max(width, height) <= MAX_SIDE_PX or step < width * channels:
        raise ValueError(
            f"impossible size of a picture: {width}x{height} pixels with {step} bytes a row"
        )
    rows = np.frombuffer(data, np.uint8, height * step).reshape(height, step)
    pixels = rows[:, : width * channels].reshape(height, width, channels)
    if channels == 1:
        pixels = np.repeat(pixels, 3, axis=2)
    elif encoding != "rgb8" and encoding != "rgba8":
        pixels = pixels[:, :, 2::-1]
    rgb = np.ascontiguousarray(pixels[:, :, :3])
    return Picture(encoding=Encoding.RGB, width=width, height=height, data=rgb.tobytes())
