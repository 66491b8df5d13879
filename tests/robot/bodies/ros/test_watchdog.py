"""Which orders a ROS robot's watchdog forwards, and for how long, in virtual time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.errors import DriveError
from robot.testing import VirtualClock
from robot.types import Action
from tests.standins.rclpy_node import WatchdogNode
from tests.standins.rosbridge_in_time import WatchedBridge

STANDS_S = 0.5


class Robot:
    """A base that keeps its last velocity forever."""

    def __init__(self, clock: VirtualClock) -> None:
        self.clock = clock
        self.speed = 0.0
        self.sign: dict[str, int] = {}
        self.is_disputed = False
        self.node = WatchdogNode(clock, self._hear)
        self.node.start()
        clock.sleep(0.1)

    def _hear(self, topic: str, kind: str, message: dict[str, Any]) -> None:
        if topic == "/cmd_vel":
            assert kind == "geometry_msgs/msg/Twist"
            self.speed = message["linear"]["x"]
        else:
            assert (topic, kind) == ("/drivelesson/alive", "std_msgs/msg/Header")
            self.sign, self.is_disputed = message["stamp"], message["frame_id"] == "disputed"

    def order(self, speed: float, seen_s: float | None = None, by: str = "one") -> None:
        driver = RosDriver(RosOptions(address="robot", watchdog=True, linear_mps=1.0))
        driver._frame = by
        sign = self.sign if seen_s is None else {"sec": 0, "nanosec": round(seen_s * 1e9)}
        driver._take_sign({"stamp": sign})
        self.node.take(driver.velocity(0.0, speed))


@pytest.fixture
def robot() -> Iterator[Robot]:
    robot = Robot(VirtualClock(100.0))
    yield robot
    robot.node.end()


def test_an_order_that_is_not_renewed_ends(robot: Robot) -> None:
    robot.order(0.3)
    assert robot.speed == 0.3
    robot.clock.sleep(0.28)
    assert robot.speed == 0.3
    robot.clock.sleep(0.04)
    assert robot.speed == 0.0


@pytest.mark.parametrize("seen_s", [0.0, 99.5, 100.5, 2e6])
def test_late_orders_and_orders_of_an_earlier_start_move_nothing(
    robot: Robot, seen_s: float
) -> None:
    robot.order(0.3, seen_s)
    assert robot.speed == 0.0


def test_a_stop_is_never_late_and_nothing_older_moves_after_a_newer_order(robot: Robot) -> None:
    old_s = robot.clock.now_s()
    robot.clock.sleep(0.1)
    robot.order(0.3)
    robot.order(0.0, 1.0)
    assert robot.speed == 0.0
    robot.order(0.4, old_s)
    assert robot.speed == 0.0


def velocity(x: float) -> dict[str, Any]:
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    return {"linear": {**zero, "x": x}, "angular": zero}


def test_while_another_node_drives_the_robot_stands_and_says_so(robot: Robot) -> None:
    robot.node.hear("/cmd_vel", velocity(0.2))
    assert not robot.is_disputed, "another node may drive while no order comes from here"
    robot.order(0.3)
    for own_or_stop in (0.3, 0.0):
        robot.node.hear("/cmd_vel", velocity(own_or_stop))
        assert robot.speed == 0.3
    for _ in range(10):
        robot.order(0.3)
        robot.clock.sleep(0.1)
        robot.speed = 0.2
        robot.node.hear("/cmd_vel", velocity(0.2))
        assert robot.speed == 0.0, "the watchdog answers each velocity of the other node by zero"
    robot.clock.sleep(0.1)
    assert robot.is_disputed
    robot.order(0.3)
    assert robot.speed == 0.0
    robot.clock.sleep(0.5)
    assert not robot.is_disputed
    robot.order(0.3)
    assert robot.speed == 0.3


def test_orders_of_two_servers_stop_the_robot(robot: Robot) -> None:
    for _ in range(3):
        robot.order(0.3)
        robot.clock.sleep(0.04)
        robot.order(0.2, by="another")
        robot.clock.sleep(0.04)
        assert robot.speed == 0.0
    robot.clock.sleep(0.5)
    robot.order(0.2, by="another")
    assert robot.speed == 0.2


def test_the_node_ends_with_a_stop(robot: Robot) -> None:
    robot.order(0.3)
    robot.node.end()
    assert robot.speed == 0.0


@given(st.lists(st.tuples(st.floats(0, 0.4), st.floats(0, 1.5)), min_size=1, max_size=6))
def test_however_orders_are_held_up_the_robot_stands_half_a_second_after_the_last_one_was_written(
    orders: list[tuple[float, float]],
) -> None:
    """Each order is written some time after the previous one, and delayed by the given time."""
    clock = VirtualClock(100.0)
    robot = Robot(clock)
    written_s, arrivals = clock.now_s(), []
    for pause_s, delay_s in orders:
        clock.sleep(max(0.0, written_s + pause_s - clock.now_s()))
        written_s = clock.now_s()
        arrivals.append((written_s + delay_s, written_s))
    for arrival_s, seen_s in sorted(arrivals):
        clock.sleep(max(0.0, arrival_s - clock.now_s()))
        robot.order(0.3, seen_s)
        if clock.now_s() > written_s + STANDS_S:
            assert robot.speed == 0.0
    clock.sleep(max(0.0, written_s + STANDS_S - clock.now_s()))
    assert robot.speed == 0.0
    robot.node.end()


@pytest.fixture
def watched() -> tuple[VirtualClock, WatchedBridge, RosDriver]:
    clock = VirtualClock(100.0)
    bridge = WatchedBridge(clock, 1)
    driver = RosDriver(RosOptions(address="robot", watchdog=True), clock)
    driver.open_topics = bridge.open
    return clock, bridge, driver


def test_a_dispute_of_two_servers_is_reported_by_the_driver(watched: Any) -> None:
    clock, bridge, driver = watched
    with driver:
        driver.send_action(Action.FORWARD)
        clock.sleep(0.06)
        bridge.hear("/cmd_vel", velocity(0.3))
        clock.sleep(0.12)
        with pytest.raises(DriveError, match="another node drives it"):
            driver.sense()
        clock.sleep(0.6)
        driver.sense()
        bridge.end()


def test_without_the_watchdogs_sign_of_life_nothing_moves(watched: Any) -> None:
    clock, bridge, driver = watched
    with driver:
        driver.send_action(Action.FORWARD)
        clock.sleep(0.1)
        assert bridge.is_moving
        bridge.end()
        assert not bridge.is_moving, "the watchdog's last message stops the robot"
        clock.sleep(0.5)
        with pytest.raises(DriveError, match=r"watchdog does not answer.*watchdog\.py"):
            driver.send_action(Action.FORWARD)
    with pytest.raises(DriveError, match="watchdog does not answer"):
        driver.connect()
    assert not driver.is_connected


def test_a_base_may_listen_elsewhere_and_take_stamped_velocities() -> None:
    clock = VirtualClock(100.0)
    heard: dict[str, tuple[str, Any]] = {}
    node = WatchdogNode(
        clock,
        lambda topic, kind, message: heard.update({topic: (kind, message)}),
        stamped=True,
        cmd_vel_topic="/base/cmd_vel",
    )
    node.start()
    clock.sleep(0.1)
    node.end()
    kind, message = heard["/base/cmd_vel"]
    assert kind == "geometry_msgs/msg/TwistStamped"
    assert (message["header"]["frame_id"], message["twist"]["linear"]["x"]) == ("base_link", 0.0)
