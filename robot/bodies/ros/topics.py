"""Topics of a ROS 2 robot: what our camera and driver need of whatever carries them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

from robot.errors import ConfigurationError

TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
TEXT, HEADER = "std_msgs/msg/String", "std_msgs/msg/Header"
COMPRESSED, RAW = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"
ODOMETRY, RANGE = "nav_msgs/msg/Odometry", "sensor_msgs/msg/Range"
VELOCITIES = (TWIST, STAMPED)
GONE_S = 0.4
"""Time without any sign of life after which the robot's end counts as gone, in seconds."""

Message = Mapping[str, Any]
"""A message by the names of its fields, as rosbridge writes it. Bytes are text in base64 there, and
bytes over DDS."""
End = tuple[Message, float]
"""A message and the seconds after which it is published, unless another one is sent before."""
OnMessage = Callable[[str, Message], None]
"""Called with topic and message, on the transport's thread; must return at once."""


class Topics(ABC):
    """Publishes on topics, and passes on the messages of others.

    Attributes:
        where: Names the other end in an error, as `rosbridge at robot.local`.
        trouble: Why the connection was lost the last time; empty if it never was.
    """

    where = "the robot"
    trouble = ""

    @property
    @abstractmethod
    def silent_s(self) -> float:
        """Seconds for which the other end has given no sign of life, though one was due."""

    @property
    @abstractmethod
    def refusal(self) -> str:
        """What the other end does not take, and why; empty if there is nothing."""

    def refused(self, refusal: str) -> str:
        """Return the sentence for a refusal."""
        return f"{self.where}: {refusal}"

    @abstractmethod
    def publish(self, topic: str, message: Message, ends: End | None = None) -> None:
        """Publish one message, and wait until it is sent; then what ends it.

        Raises:
            OSError: If it cannot be sent now; it is not sent later.
        """

    @abstractmethod
    def publish_soon(self, topic: str, message: Message) -> None:
        """Publish without waiting; dropped while the one before is still being sent."""

    @abstractmethod
    def close(self) -> None:
        """End all; idempotent."""


def check_topic(flag: str, name: str) -> None:
    """Raise ConfigurationError unless this is the name of a topic."""
    words = name.removeprefix("/").split("/")
    if not all(word.isidentifier() and word.isascii() for word in words):
        raise ConfigurationError(f"{flag} must be a topic's name, as /cmd_vel, not {name!r}")
