"""Reads bags of ROS 1 and 2: pictures of a camera, and the robot's velocity commands.

A bag contains the time at which each picture and each velocity was received, all by the same clock.
A velocity is valid until the next velocity. The library `rosbags` reads the bags; it does not need
ROS.
"""

from __future__ import annotations

import bisect
import contextlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robot.devkit.pictures import MAX_SIDE_PX, Picture, read_picture
from robot.errors import RecordingError, RobotError, need
from robot.exchange.drive import Drive, FrameEvent, ImportReport, drive_of
from robot.exchange.files import read_text
from robot.exchange.film import to_jpeg
from robot.exchange.own import is_own
from robot.exchange.reading import Reading
from robot.exchange.steering import FULL_MPS, FULL_TURN_RAD_S, at_velocity, read_number

ROSBAGS = ("rosbags.highlevel", "reading ROS bags", "rosbags")
"""Arguments of `need` for the library `rosbags`: its name, its purpose here, and the extra that
installs it."""
_COMPRESSED, _RAW = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"
_TWISTS = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
_UNCHANGED = "RGB"
_CONVERTED = {
    "rgb8": _UNCHANGED,
    "bgr8": "BGR2RGB",
    "8UC3": "BGR2RGB",
    "mono8": "GRAY2RGB",
    "8UC1": "GRAY2RGB",
    "rgba8": "RGBA2RGB",
    "bgra8": "BGRA2RGB",
    "8UC4": "BGRA2RGB",
    "yuv422": "YUV2RGB_UYVY",
    "uyvy": "YUV2RGB_UYVY",
    "yuv422_yuy2": "YUV2RGB_YUYV",
    "yuyv": "YUV2RGB_YUYV",
    # OpenCV names a Bayer pattern by its second row; ROS names it by its first row.
    "bayer_rggb8": "BayerBG2RGB",
    "bayer_bggr8": "BayerRG2RGB",
    "bayer_gbrg8": "BayerGR2RGB",
    "bayer_grbg8": "BayerGB2RGB",
}
"""For each encoding of ROS, the OpenCV conversion that makes a colour picture from it. An encoding
with 16 bits, such as `mono16`, is converted like the encoding with 8 bits."""
_CHANNELS = {_UNCHANGED: 3, "BGR2RGB": 3, "RGBA2RGB": 4, "BGRA2RGB": 4}
_LEAST_BAYER_PX = 3
"""Smallest width and height of a Bayer picture. From smaller ones OpenCV makes black pixels."""
Order = tuple[int, float, float]
"""A velocity command: its time in nanoseconds, speed ahead (m/s) and turn to the left (rad/s)."""


def is_bag(path: Path) -> bool:
    """True for a bag of either version: a file, or a folder with a description."""
    if path.is_file():
        suffix = path.suffix.lower()
        return suffix in (".bag", ".db3") or (suffix == ".mcap" and not is_own(path))
    about = path / "metadata.yaml"
    return about.is_file() and "rosbag2_bagfile_information" in read_text(about)


def read_bag(path: Path, reading: Reading, report: ImportReport) -> Drive:
    """Read a bag. The pictures are not read now, but one by one when the imported recording is
    written.

    Raises RecordingError if the bag is damaged, if it has no camera or no velocities, or if it has
    several of them and `--topics` does not choose one.
    """
    bag = _Bag(path)
    with bag.opened() as reader:
        cameras, told = _topics(path, reader, reading, report)
        camera = cameras[0].topic
        orders = _orders(reader, told, report)
        stamps = [stamp for stamp, _, _ in orders]
        taken = [
            (stamp, index)
            for index, (_, stamp, _) in enumerate(reader.messages(connections=cameras))
        ]
    picture_at = bag.pictures(camera)

    def read(place: str, found: tuple[int, int]) -> FrameEvent:
        stamp, index = found
        at = bisect.bisect_right(stamps, stamp) - 1
        label, point = (None, None)
        if at >= 0:
            _, linear, turn = orders[at]
            label, point = at_velocity(linear / FULL_MPS, turn / FULL_TURN_RAD_S, reading)
        return FrameEvent(
            place=place,
            t_s=stamp / 1e9,
            label=label,
            point=point,
            picture=partial(picture_at, index),
        )

    numbered = ((f"{camera} picture {index}", found) for index, found in enumerate(taken))
    return drive_of(
        numbered,
        read,
        f"{path}: {camera} has no pictures",
        name=path.stem,
        source="ROS bag",
        started_at_s=taken[0][0] / 1e9 if taken else 0.0,
        report=report,
    )


class _Bag:
    """A bag on the disk."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @contextlib.contextmanager
    def opened(self) -> Iterator[Any]:
        """Open the bag; raises RecordingError if it is damaged."""
        high, types = need(*ROSBAGS), need("rosbags.typesys", *ROSBAGS[1:])
        # needed for a bag that does not define its message types
        store = types.get_typestore(types.Stores.LATEST)
        try:
            with high.AnyReader([self._path], default_typestore=store) as reader:
                yield reader
        except (RobotError, KeyboardInterrupt):
            raise
        except Exception as error:  # errors of the library or its dependencies
            why = str(error)[:200] or repr(error)
            text = f"the ROS bag {self._path} cannot be read: {why}{self._remedy()}"
            raise RecordingError(text) from error

    def _remedy(self) -> str:
        """Return a clause that names the tool for a bag that was not closed, as after a power cut;
        empty if there is no tool."""
        is_mcap = self._path.suffix.lower() == ".mcap" or any(self._path.glob("*.mcap"))
        tool = "mcap recover" if is_mcap else "rosbag reindex"
        has_tool = is_mcap or self._path.suffix.lower() == ".bag"
        return f"; if the recording was cut off, repair it with: {tool}" if has_tool else ""

    def pictures(self, topic: str) -> Callable[[int], Picture]:
        """Return a function that reads the picture with a given number from this topic. Reading in
        ascending order is fastest."""
        messages: Iterator[tuple[Any, str]] = iter(())
        following = 0

        def read_all() -> Iterator[tuple[Any, str]]:
            with self.opened() as reader:
                wanted = [each for each in reader.connections if each.topic == topic]
                for connection, _, data in reader.messages(connections=wanted):
                    yield reader.deserialize(data, connection.msgtype), connection.msgtype

        def picture(index: int) -> Picture:
            nonlocal messages, following
            if index < following or not following:
                messages, following = read_all(), 0
            found = None
            while following <= index:
                found = next(messages, None)
                following += 1
            if found is None:
                raise RecordingError("the bag ends before this picture")
            return _picture(*found)

        return picture


def _topics(path: Path, reader: Any, reading: Reading, report: ImportReport) -> tuple[Any, Any]:
    """Return the connections of the camera and of the velocities."""
    there = [each for each in reader.connections if each.msgcount != 0]
    for name in reading.topics:
        if name not in {each.topic for each in there}:
            known = ", ".join(sorted({each.topic for each in there}))[:300]
            raise RecordingError(f"{path} has no messages on {name}; its topics: {known}")
    cameras = _chosen(there, (_COMPRESSED, _RAW), reading)
    cameras = [each for each in cameras if "compressedDepth" not in each.topic]
    told = _chosen(there, _TWISTS, reading)
    for found, what in ((cameras, "pictures (CompressedImage or Image)"), (told, "Twist")):
        names = sorted({each.topic for each in found})
        if not names:
            types = ", ".join(sorted({f"{each.topic} ({each.msgtype})" for each in there}))[:400]
            raise RecordingError(f"{path} has no {what}; it has {types or 'no messages'}")
        if len(names) > 1:
            raise RecordingError(
                f"{path} has {what} on {len(names)} topics: {', '.join(names)}; "
                "choose the topics with --topics CAMERA,VELOCITIES"
            )
    report.remark(f"topics: {cameras[0].topic}, {told[0].topic}")
    return cameras, told


def _chosen(there: list[Any], types: tuple[str, ...], reading: Reading) -> list[Any]:
    found = [each for each in there if each.msgtype in types]
    return [each for each in found if each.topic in reading.topics] or found


def _orders(reader: Any, connections: list[Any], report: ImportReport) -> list[Order]:
    orders = []
    for connection, stamp, data in reader.messages(connections=connections):
        message = reader.deserialize(data, connection.msgtype)
        twist = getattr(message, "twist", message)
        try:
            linear = read_number(twist.linear.x, "linear.x")
            turn = read_number(twist.angular.z, "angular.z")
        except ValueError as error:
            report.skip(f"{connection.topic} at {stamp / 1e9:.2f} s", str(error))
            continue
        orders.append((stamp, linear, turn))
    return orders


def _picture(message: Any, kind: str) -> Picture:
    """Return a message's picture; raises RecordingError if it is damaged or a depth picture."""
    if kind == _COMPRESSED:
        return read_picture(bytes(message.data), "the picture")
    encoding, width, height = message.encoding, int(message.width), int(message.height)
    depth = 2 if encoding.endswith("16") else 1
    conversion = _CONVERTED.get(f"{encoding.removesuffix('16')}8" if depth == 2 else encoding)
    if conversion is None:
        known = "depth" if encoding in ("16UC1", "32FC1") else "of an unknown encoding"
        raise RecordingError(
            f"the picture is {known} ({encoding[:20]}), but must be colour or grey"
        )
    channels = _CHANNELS.get(conversion, 2 if conversion.startswith("YUV") else 1)
    row = width * channels * depth
    data = np.frombuffer(bytes(message.data), np.uint8)
    is_too_small = conversion.startswith("Bayer") and min(width, height) < _LEAST_BAYER_PX
    is_halved = conversion.startswith("YUV") and width % 2  # two pixels share their colour
    is_impossible = not 0 < height <= MAX_SIDE_PX or not 0 < width <= MAX_SIDE_PX
    if is_impossible or is_too_small or is_halved:
        raise RecordingError(
            f"the picture claims to be {width}x{height} pixels, which is impossible for {encoding}"
        )
    if message.step < row or data.size < message.step * height:
        raise RecordingError("the picture is damaged: it has fewer bytes than its size needs")
    rows = data[: message.step * height].reshape(height, message.step)[:, :row]
    high = rows[:, 0 if message.is_bigendian else depth - 1 :: depth]
    pixels = np.ascontiguousarray(high).reshape(height, width, channels)
    if conversion != _UNCHANGED:
        import cv2

        pixels = cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{conversion}"))
    return to_jpeg(pixels)
