"""ROS 2 messages over DDS. On the wire, types are named `pkg::msg::dds_::Name_`, and topics are
named `rt/...`.

Fields and their order: github.com/ros2/common_interfaces, rcl_interfaces (builtin_interfaces). This
module must not postpone the evaluation of annotations, because cyclonedds 11.0.1 cannot resolve
strings such as "str".
"""

import functools
import re
import struct
import typing
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Self

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, sequence, uint8, uint32

from robot.bodies.ros import topics
from robot.bodies.ros.topics import Message

_ROS_TYPE = re.compile(r"(\w+)::(\w+)::dds_::(\w+)_")
_PREFIX = "rt/"


def dds_topic(name: str) -> str:
    """Return a topic's name on the wire: `/cmd_vel` is `rt/cmd_vel`."""
    return _PREFIX + name.removeprefix("/")


def ros_topic(name: str) -> str | None:
    """Return the ROS name of a DDS topic. Return None if the DDS topic is not a ROS topic, for
    example if it belongs to a service."""
    return "/" + name.removeprefix(_PREFIX) if name.startswith(_PREFIX) else None


def ros_type(name: str) -> str:
    """Return a type's name in ROS: `std_msgs::msg::dds_::String_` is `std_msgs/msg/String`."""
    found = _ROS_TYPE.fullmatch(name)
    return "/".join(found.groups()) if found else name


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """Seconds and nanoseconds of the sender's clock."""

    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """Time and frame of a message."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    """A string."""

    data: str = ""


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """Three numbers."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    """A velocity, in metres and radians a second."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    """A velocity with the time at which it was sent."""

    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


@dataclass
class Position(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    """A place, in metres."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    """A rotation."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class PoseMessage(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    """A place and a rotation."""

    position: Position = field(default_factory=Position)
    orientation: Quaternion = field(default_factory=Quaternion)


def _unknown() -> list[float]:
    return [0.0] * 36


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    """A place and a rotation with their covariance."""

    pose: PoseMessage = field(default_factory=PoseMessage)
    covariance: array[float64, 36] = field(default_factory=_unknown)


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    """A velocity with its covariance."""

    twist: Twist = field(default_factory=Twist)
    covariance: array[float64, 36] = field(default_factory=_unknown)


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    """The robot's pose by odometry."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@dataclass
class Range(IdlStruct, typename="sensor_msgs::msg::dds_::Range_"):
    """A distance. ROS 2 Jazzy added a field `variance` at the end of this message, which is not
    read."""

    header: Header = field(default_factory=Header)
    radiation_type: uint8 = 0
    field_of_view: float32 = 0.0
    min_range: float32 = 0.0
    max_range: float32 = 0.0
    range: float32 = 0.0


class _Reading:
    """Reads plain CDR faster than the library, which converts a picture's bytes to a list."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = memoryview(data), 4
        self._order = "<" if data[1] & 1 else ">"

    def number(self, code: str) -> int:
        """Read a number, aligned to its size."""
        size = struct.calcsize(code)
        self._at += -(self._at - 4) % size
        (value,) = struct.unpack_from(self._order + code, self._data, self._at)
        self._at += size
        return int(value)

    def octets(self) -> bytes:
        """Read a length, and then as many bytes."""
        length = self.number("I")
        data = bytes(self._data[self._at : self._at + length])
        if len(data) != length:
            raise ValueError(f"{length} bytes were announced, but {len(data)} arrived")
        self._at += length
        return data

    def text(self) -> str:
        """Read a string, which ends with a zero byte."""
        return self.octets().rstrip(b"\0").decode(errors="replace")

    def header(self) -> Header:
        """Read time and frame."""
        return Header(Time(self.number("i"), self.number("I")), self.text())


@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImage_"):
    """A picture as a file: JPEG or PNG."""

    header: Header = field(default_factory=Header)
    format: str = ""
    data: sequence[uint8] = b""

    @classmethod
    def deserialize(cls, data: bytes, *_: Any, **__: Any) -> Self:
        """Read the message from CDR, with `data` as bytes."""
        reading = _Reading(data)
        return cls(reading.header(), reading.text(), reading.octets())


@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    """A picture's pixels, row by row; `step` is the length of a row in bytes."""

    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    encoding: str = ""
    is_bigendian: uint8 = 0
    step: uint32 = 0
    data: sequence[uint8] = b""

    @classmethod
    def deserialize(cls, data: bytes, *_: Any, **__: Any) -> Self:
        """Read the message from CDR, with `data` as bytes."""
        reading = _Reading(data)
        return cls(
            reading.header(),
            reading.number("I"),
            reading.number("I"),
            reading.text(),
            reading.number("B"),
            reading.number("I"),
            reading.octets(),
        )


TYPES: dict[str, type[IdlStruct]] = {
    topics.TWIST: Twist,
    topics.STAMPED: TwistStamped,
    topics.TEXT: String,
    topics.HEADER: Header,
    topics.COMPRESSED: CompressedImage,
    topics.RAW: Image,
    topics.ODOMETRY: Odometry,
    topics.RANGE: Range,
}


@functools.cache
def _hints(kind: Any) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def to_dds(kind: type[Any], message: Message) -> Any:
    """Make a message from the values of its fields."""
    hints = _hints(kind)  # type: ignore[arg-type]
    return kind(
        **{
            name: to_dds(hints[name], value) if is_dataclass(hints[name]) else value
            for name, value in message.items()
        }
    )


def from_dds(sample: Any) -> dict[str, Any]:
    """Return the values of a message's fields."""
    return {
        each.name: from_dds(value) if is_dataclass(value) else value
        for each in fields(sample)
        for value in (getattr(sample, each.name),)
    }
