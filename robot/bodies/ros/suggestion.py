"""Suggests options that fit the topics found on a ROS 2 robot. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from robot.bodies.ros.camera import RosCameraOptions
from robot.bodies.ros.driver import ORDERS, RosOptions
from robot.bodies.ros.topics import COMPRESSED, ODOMETRY, RANGE, RAW, STAMPED, TWIST

_NOT_FOR_DRIVING = ("depth", "theora", "infra", "mask", "map")
"""Words in a topic's name that show that its pictures are not meant for a pilot."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Another program's publisher or subscriber.

    Attributes:
        topic, kind: Topic and type by their ROS names.
        publishes: True for a publisher.
        seen_s: The time at which the endpoint was discovered.
    """

    topic: str
    kind: str
    publishes: bool
    seen_s: float = 0.0


def suggest(endpoints: Iterable[Endpoint]) -> list[str]:
    """Return the options of `drivelesson serve --robot ros --camera ros` that differ from the
    defaults. If the robot has our watchdog, it is driven through the watchdog.

    Example:
        >>> suggest([Endpoint("/base/cmd_vel", "geometry_msgs/msg/TwistStamped", False)])
        ['--cmd-vel-topic', '/base/cmd_vel', '--stamped', 'true']
    """
    seen = list(endpoints)
    return [*_velocity(seen), *_picture(seen), *_sensors(seen)]


def _velocity(seen: list[Endpoint]) -> list[str]:
    if _named(seen, STAMPED, publishes=False, preferred=ORDERS) == ORDERS:
        return ["--watchdog", "true"]
    default = RosOptions().cmd_vel_topic
    for kind, words in ((TWIST, []), (STAMPED, ["--stamped", "true"])):
        if topic := _named(seen, kind, publishes=False, preferred=default):
            return [*_unless_default("--cmd-vel-topic", topic, default), *words]
    return []


def _picture(seen: list[Endpoint]) -> list[str]:
    default = RosCameraOptions().image_topic
    for kind, words in ((COMPRESSED, []), (RAW, ["--image-type", "raw"])):
        if topic := _named(seen, kind, publishes=True, preferred=default):
            return [*_unless_default("--image-topic", topic, default), *words]
    return []


def _sensors(seen: list[Endpoint]) -> list[str]:
    words = []
    for flag, kind, usual in (
        ("--odometry-topic", ODOMETRY, "/odom"),
        ("--range-topic", RANGE, "/range"),
    ):
        if topic := _named(seen, kind, publishes=True, preferred=usual):
            words += [flag, topic]
    return words


def _named(seen: list[Endpoint], kind: str, *, publishes: bool, preferred: str) -> str:
    """Return the best topic of a type: the one with the usual name, or else the one with the
    shortest name. Topics with a word of `_NOT_FOR_DRIVING` come last."""
    names = {each.topic for each in seen if (each.kind, each.publishes) == (kind, publishes)}

    def distance(name: str) -> tuple[bool, bool, int, str]:
        is_odd = any(word in name.lower() for word in _NOT_FOR_DRIVING)
        return name != preferred, is_odd, len(name), name

    return min(names, key=distance, default="")


def _unless_default(flag: str, topic: str, default: str) -> list[str]:
    return [] if topic == default else [flag, topic]
