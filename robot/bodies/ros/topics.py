"""Topics of a ROS 2 robot: the interface between our camera and driver and the transport."""

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
"""Time without any sign of life after which the other end counts as gone, in seconds."""

Message = Mapping[str, Any]
"""A message as a mapping of field names to values. Binary data is base64 text over rosbridge, and
`bytes` over DDS."""
End = tuple[Message, float]
"""A message, and the delay in seconds after which it is published, unless another message is sent
first."""
OnMessage = Callable[[str, Message], None]
"""Called with topic and message on the transport's thread; must return immediately."""


class Topics(ABC):
    """Publishes messages on topics, and passes on received messages.

    Attributes:
        where: The other end's name in an error, for example `rosbridge at robot.local`.
        trouble: The reason for the last loss of the connection; empty if there was none.
    """

    where = "the robot"
    trouble = ""

    @property
    @abstractmethod
    def silent_s(self) -> float:
        """The time for which an expected sign of life from the other end has been missing, in
        seconds."""

    @property
    @abstractmethod
    def refusal(self) -> str:
        """The message that the receiver refuses, and the reason; empty if it refuses none."""

    def refused(self, refusal: str) -> str:
        """Return the sentence about a refusal."""
        return f"{self.where}: {refusal}"

    @abstractmethod
    def publish(self, topic: str, message: Message, ends: End | None = None) -> None:
        """Publish one message, and wait until it is sent. `ends` is a second message, for example a
        stop, and the delay after which it is published.

        Raises:
            OSError: If the message cannot be sent now; the message is then never sent.
        """

    @abstractmethod
    def publish_soon(self, topic: str, message: Message) -> None:
        """Publish without waiting. If the previous message is still being sent, this one is
        dropped."""

    @abstractmethod
    def close(self) -> None:
        """End the connection and its threads; idempotent."""


def check_topic(flag: str, name: str) -> None:
    """Raise ConfigurationError unless this is the name of a topic."""
    words = name.removeprefix("/").split("/")
    if not all(word.isidentifier() and word.isascii() for word in words):
        raise ConfigurationError(f"{flag} must be a topic's name, such as /cmd_vel, not {name!r}")
