"""Support for tests: fakes, a robot made of fakes in virtual time, and contract suites for drivers
and cameras."""

from robot.testing.camera import FakeCamera
from robot.testing.driver import FakeDriver
from robot.testing.link import Line, Link, LinkConditions
from robot.testing.policy import FakePolicy
from robot.testing.virtual_clock import VirtualClock
from robot.testing.world import VirtualRobot

__all__ = [
    "FakeCamera",
    "FakeDriver",
    "FakePolicy",
    "Line",
    "Link",
    "LinkConditions",
    "VirtualClock",
    "VirtualRobot",
]
