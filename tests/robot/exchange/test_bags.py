"""Bags of ROS 1 and 2, written by `rosbags`, are imported with the right labels and colours."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot.errors import RecordingError
from robot.types import Action

from .imported import drive_at, import_from, labels_by_number, picture, pixels

L, F, R = Action.LEFT, Action.FORWARD, Action.RIGHT
Labels = dict[int, Action | None]
CHANNELS = {"mono": 1, "bayer": 1, "yuv422": 2}


@cache
def typestore(is_first: bool) -> Any:
    """Return the message types of ROS 1 or 2; making them takes long."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC if is_first else Stores.ROS2_HUMBLE)


def write_bag(
    path: Path,
    form: str,
    encoding: str,
    is_stamped: bool,
    size: tuple[int, int] = (160, 120),
    rows: NDArray[np.uint8] | None = None,
) -> Labels:
    """Write a bag of ROS 1 or 2 with `rosbags`; return the label of each picture.

    `rows` are the bytes of each picture, shape (height, bytes of a row); by default they show the
    picture's number.
    """
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    is_first = form == "bag"
    store = typestore(is_first)
    types = store.types

    def header(at_ns: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=at_ns // 10**9, nanosec=at_ns % 10**9)
        more = {"seq": 0} if is_first else {}
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera", **more)

    def image(number: int, at_ns: int) -> Any:
        if not encoding:
            kind, packed = types["sensor_msgs/msg/CompressedImage"], picture(number)
            data = np.frombuffer(packed, np.uint8)
            return kind(header=header(at_ns), format="jpeg", data=data)
        kind, data = types["sensor_msgs/msg/Image"], rows
        if data is None:
            channels = next((n for name, n in CHANNELS.items() if name in encoding), 3)
            shown = pixels(number)[: size[1], : size[0], :channels]
            if encoding.endswith("16"):
                shown = np.ascontiguousarray(shown.astype("<u2") << 8).view(np.uint8)
            data = np.ascontiguousarray(shown).reshape(size[1], -1)
        sides = {"height": size[1], "width": size[0], "step": data.shape[1], "is_bigendian": 0}
        return kind(header=header(at_ns), encoding=encoding, data=data.reshape(-1), **sides)

    def order(turn: float, at_ns: int) -> Any:
        vector, kind = types["geometry_msgs/msg/Vector3"], "geometry_msgs/msg/Twist"
        ahead, side = vector(x=0.3, y=0.0, z=0.0), vector(x=0.0, y=0.0, z=turn)
        twist = types[kind](linear=ahead, angular=side)
        return types[f"{kind}Stamped"](header=header(at_ns), twist=twist) if is_stamped else twist

    plugin = StoragePlugin.SQLITE3 if form == "db3" else StoragePlugin.MCAP
    writer: Any = Writer1(path) if is_first else Writer2(path, version=9, storage_plugin=plugin)
    write = store.serialize_ros1 if is_first else store.serialize_cdr
    labels: Labels = {4: None, 1: L, 2: R, 3: F, 5: F}
    turns = {1: 0.5, 2: -0.5, 3: 0.0}
    with writer:
        connections: dict[str, Any] = {}
        for place, number in enumerate(labels):
            at_ns = (17 * 10**9 + place) * 10**8
            told = [("/cmd_vel", order(turns[number], at_ns))] if number in turns else []
            for topic, message in (*told, ("/camera/image", image(number, at_ns))):
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                writer.write(connections[topic], at_ns, write(message, kind))
    return labels


@pytest.mark.parametrize(
    ("form", "encoding", "is_stamped"),
    [
        ("bag", "", False),
        ("db3", "rgb8", True),
        ("mcap", "mono8", False),
        ("mcap file", "mono16", True),
    ],
)
def test_a_ros_bag_is_imported_and_a_velocity_holds_until_the_next(
    form: str, encoding: str, is_stamped: bool, tmp_path: Path
) -> None:
    path = tmp_path / ("drive.bag" if form == "bag" else "drive")
    labels = write_bag(path, form, encoding, is_stamped)
    if form == "mcap file":
        [path] = path.glob("*.mcap")
    assert labels_by_number(import_from(path, tmp_path / "got.mcap")) == labels


RED, BLUE = (200, 0, 0), (0, 0, 200)
RED_YUV, BLUE_YUV = (65, 103, 221), (40, 221, 111)
"""Brightness from 16 to 235, and the two colour differences around 128 (ITU-R BT.601)."""


def coded(encoding: str, width: int, height: int) -> NDArray[np.uint8]:
    """Return the rows of a picture that is red on the left and blue on the right."""
    is_right = np.arange(width) >= width // 2
    rgb = np.broadcast_to(np.where(is_right[:, None], BLUE, RED), (height, width, 3))
    yuv = np.broadcast_to(np.where(is_right[:, None], BLUE_YUV, RED_YUV), (height, width, 3))
    if encoding.startswith("bayer"):
        pattern = np.array(["rgb".index(letter) for letter in encoding[6:10]]).reshape(2, 2)
        channel = np.tile(pattern, (height // 2, width // 2))[..., None]
        rows = np.take_along_axis(rgb, channel, axis=2)
    elif encoding in ("uyvy", "yuyv"):
        difference = np.where(np.arange(width) % 2, yuv[..., 2], yuv[..., 1])
        rows = np.stack([difference, yuv[..., 0]], axis=2)
        if encoding == "yuyv":
            rows = rows[..., ::-1]
    else:
        rows = rgb[..., ["rgb".index(letter) for letter in encoding[:3]]]
        if encoding[3] == "a":
            rows = np.pad(rows, ((0, 0), (0, 0), (0, 1)), constant_values=255)
    wide = rows.astype("<u2") << 8 if encoding.endswith("16") else rows.astype("u1")
    return np.ascontiguousarray(wide).view(np.uint8).reshape(height, -1)


@pytest.mark.parametrize(
    "encoding",
    [
        *("rgb8", "bgr8", "rgba8", "bgra8", "rgb16", "uyvy", "yuyv"),
        *("bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg16"),
    ],
)
def test_colours_of_a_bag_are_right_and_the_padding_of_rows_is_left_out(
    encoding: str, tmp_path: Path
) -> None:
    width, height = 48, 32
    rows = np.pad(coded(encoding, width, height), ((0, 0), (0, 5)), constant_values=99)
    write_bag(tmp_path / "drive.bag", "bag", encoding, False, (width, height), rows)
    shown = drive_at(tmp_path / "drive.bag").shots[0].picture()
    assert (shown.width, shown.height) == (width, height)
    bgr = cv2.imdecode(np.frombuffer(shown.data, np.uint8), cv2.IMREAD_COLOR)
    for column, colour in ((10, RED), (38, BLUE)):
        assert np.abs(bgr[4:-4, column, ::-1].astype(int) - colour).max() < 25


@pytest.mark.parametrize(
    ("encoding", "size", "complaint"),
    [
        ("yuv422", (7, 5), "7x5 pixels, which is impossible for yuv422"),
        ("bayer_rggb8", (4, 2), "4x2 pixels, which is impossible for bayer_rggb8"),
        ("yuv444", (8, 6), r"of an unknown encoding \(yuv444\)"),
    ],
)
def test_a_picture_that_its_encoding_cannot_hold_is_refused(
    encoding: str, size: tuple[int, int], complaint: str, tmp_path: Path
) -> None:
    write_bag(tmp_path / "drive.bag", "bag", encoding, False, size)
    with pytest.raises(RecordingError, match=complaint):
        import_from(tmp_path / "drive.bag", tmp_path / "got.mcap")
