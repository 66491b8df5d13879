"""A ROS 2 robot on DDS, with a base that never stops by itself, a camera, and our watchdog."""

from __future__ import annotations

import functools
import itertools
import os
import threading
import time
from collections.abc import Callable
from typing import Any, Self

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from robot.bodies.ros.dds import Participant, configuration
from robot.bodies.ros.driver import ALIVE, ORDERS
from robot.bodies.ros.messages import TYPES, CompressedImage, dds_topic, from_dds, to_dds
from robot.bodies.ros.topics import COMPRESSED, HEADER, STAMPED, TWIST
from robot.clock import RealClock
from robot.types import Point
from tests.kit.frames import grey_jpeg
from tests.standins.rclpy_node import WatchdogNode

IMAGES, BASE = "/camera/image_raw/compressed", "/cmd_vel"
HERE = ("127.0.0.1",)
AS_ROS = Qos(Policy.Reliability.Reliable(100_000_000), Policy.History.KeepLast(10))


def own_domain() -> int:
    """Return a domain for this process and its children, because other tests run at the same time.

    The domain is at most 101, because Linux may use the ports of higher domains for any connection.
    """
    return 1 + os.getpid() % 100


class DdsRobot:
    """A robot on DDS; once `frozen`, it receives and sends nothing more.

    Args:
        domain: The robot's domain.
    """

    def __init__(self, domain: int) -> None:
        self.domain, self.frozen, self.cmd_vel = domain, threading.Event(), list[dict[str, Any]]()
        self._ending = threading.Event()
        self._shared = Participant.join(domain, configuration(HERE, ""))
        self.participant = DomainParticipant(domain)
        self._signs = self.writer(ALIVE, HEADER)
        self._base, self._pictures = self.writer(BASE, TWIST), self.writer(IMAGES, COMPRESSED)
        self._node = WatchdogNode(RealClock(), self._say)
        self._readers: dict[Callable[[dict[str, Any]], None], Any] = {
            self.cmd_vel.append: self.reader(BASE, TWIST)
        }
        self._threads = [threading.Thread(target=run) for run in (self._listen, self._show)]

    def writer(self, topic: str, kind: str) -> Any:
        return DataWriter(self.participant, self._topic(topic, kind), AS_ROS)

    def reader(self, topic: str, kind: str) -> Any:
        return DataReader(self.participant, self._topic(topic, kind), AS_ROS)

    def _topic(self, name: str, kind: str) -> Any:
        return Topic(self.participant, dds_topic(name), TYPES[kind])

    def __enter__(self) -> Self:
        self._node.start()
        while len(self._node.subscribed) < 2:
            time.sleep(0.001)
        for name, kind in ((ORDERS, STAMPED), (BASE, TWIST)):
            self._readers[functools.partial(self._node_hears, name)] = self.reader(name, kind)
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ending.set()
        for thread in self._threads:
            thread.join()
        self._node.end()
        self._readers.clear()
        del self._base, self._pictures, self._signs, self.participant
        self._shared.leave()

    @property
    def drives(self) -> Point:
        """The base's last order: its turn rate to the right, and its speed ahead."""
        if not self.cmd_vel:
            return Point(0.0, 0.0)
        return Point(-self.cmd_vel[-1]["angular"]["z"], self.cmd_vel[-1]["linear"]["x"])

    def _say(self, topic: str, kind: str, message: dict[str, Any]) -> None:
        if topic == BASE:
            self._base.write(to_dds(TYPES[TWIST], message))
        elif not self.frozen.is_set():
            self._signs.write(to_dds(TYPES[HEADER], message))

    def _node_hears(self, topic: str, message: dict[str, Any]) -> None:
        if not (topic == ORDERS and self.frozen.is_set()):
            self._node.hear(topic, message)

    def _listen(self) -> None:
        while not self._ending.wait(0.002):
            for take, reader in list(self._readers.items()):
                for sample in reader.take(10):
                    if sample.sample_info.valid_data:
                        take(from_dds(sample))

    def _show(self) -> None:
        for index in itertools.count():
            if self._ending.wait(0.03):
                return
            if not self.frozen.is_set():
                self._pictures.write(CompressedImage(format="jpeg", data=list(grey_jpeg(index))))
