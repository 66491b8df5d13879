"""A ROS robot's velocities, pictures, sensors and advice; and the driver's reaction if rosbridge
refuses or is gone."""

from __future__ import annotations

import json
import logging
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any
from unittest import mock

import pytest

from robot.bodies.ros.camera import RosCamera, RosCameraOptions, read_pixels
from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.bodies.ros.refusals import REFUSED_S
from robot.bodies.ros.topics import GONE_S, ODOMETRY, RANGE
from robot.clock import RealClock
from robot.driver import Pose
from robot.errors import CameraError, ConfigurationError, DriveError
from robot.testing import VirtualClock
from robot.types import Action, Prediction
from tests.contract.real_parts import check_real_camera, check_real_driver
from tests.kit.frames import grey_jpeg
from tests.kit.needed import installed
from tests.kit.wait import wait_until
from tests.robot.bodies.ros.topics import HeldTopics
from tests.robot.bodies.sending import error_while_driving, send_until
from tests.standins.firmware import ROOT
from tests.standins.rosbridge import RosBridgeServer


def driver_on(topics: HeldTopics, **options: Any) -> RosDriver:
    driver = RosDriver(RosOptions(address="base", **options), VirtualClock(100.0))
    driver.open_topics = topics.open
    return driver


def speeds(message: dict[str, Any]) -> tuple[float, float]:
    twist = message.get("twist", message)
    return twist["linear"]["x"], twist["angular"]["z"]


def test_moves_are_velocities_in_metres_and_radians_and_end_with_zero() -> None:
    topics, moves = HeldTopics(), "forward,left,spin_right,fast:0:1,half_left:-0.5:0.25"
    with driver_on(topics, linear_mps=0.4, turn_rate_deg_s=90.0, body_moves=moves) as driver:
        assert topics.advertised == {"/cmd_vel": "geometry_msgs/msg/Twist"}
        topics.published.clear()
        for move in driver.moves:
            driver.send_action(move, speed_scale=0.5)
    turn = math.pi / 2
    wanted = [(0.1, 0), (0.1, turn / 2), (0, -turn / 2), (0.2, 0), (0.05, turn / 4), (0, 0)]
    assert [speeds(told) for _, told, _ in topics.published] == [pytest.approx(w) for w in wanted]
    for _, _, ends in topics.published[:-1]:
        assert (speeds(ends[0]), ends[1]) == ((0.0, 0.0), 0.4)


def test_stamped_velocities_carry_the_time() -> None:
    topics = HeldTopics()
    with driver_on(topics, stamped=True) as driver:
        driver.send_action(Action.FORWARD)
        topic, message, _ = topics.published[-1]
    assert topics.advertised == {"/cmd_vel": "geometry_msgs/msg/TwistStamped"}
    assert (topic, speeds(message)) == ("/cmd_vel", (0.2, 0.0))
    stamp = message["header"]["stamp"]
    assert stamp["sec"] + stamp["nanosec"] / 1e9 == pytest.approx(driver._clock.wall_s(), abs=1e-3)


def test_odometry_and_range_are_sensed_while_they_are_fresh() -> None:
    topics = HeldTopics()
    with driver_on(topics, odometry_topic="/odom", range_topic="/ir") as driver:
        assert topics.subscribed == {"/odom": ODOMETRY, "/ir": RANGE}
        turned = {"x": 0.0, "y": 0.0, "z": 1.0, "w": 1.0}
        at = {"x": 1.5, "y": -2.0, "z": 0.0}
        topics.on_message("/odom", {"pose": {"pose": {"position": at, "orientation": turned}}})
        topics.on_message("/ir", {"range": 0.5, "min_range": 0.1, "max_range": 2.0})
        sensed = driver.sense()
        heading = pytest.approx(math.pi / 2)
        assert sensed.pose == Pose(x_m=1.5, y_m=-2.0, heading_rad=heading, is_estimate=True)
        assert sensed.distance_m == 0.5
        topics.on_message("/ir", {"range": math.inf, "min_range": 0.1, "max_range": 2.0})
        for broken in ({}, {"pose": 3}, {"pose": {"pose": {"position": {}}}}):
            topics.on_message("/odom", broken)
        assert driver.sense().distance_m is None and driver.sense().pose is not None
        driver._clock.sleep(1.0)
        assert driver.sense().pose is None


def test_what_the_learner_would_do_is_a_topic() -> None:
    topics = HeldTopics()
    with driver_on(topics, advice_topic="/advice") as driver:
        driver.advise(Prediction(frame_id=7, action=Action.LEFT, confidence=0.123456))
    assert topics.advertised["/advice"] == "std_msgs/msg/String"
    [data] = [message["data"] for topic, message, _ in topics.published if topic == "/advice"]
    assert json.loads(data) == {"move": "left", "confidence": 0.1235, "novel": False, "frame": 7}


@pytest.mark.parametrize(
    ("watchdog", "who"), [(False, "only the robot's own base can"), (True, "the watchdog")]
)
def test_a_silent_or_refusing_robot_is_an_error_but_a_stop_is_still_sent(
    watchdog: bool, who: str
) -> None:
    topics = HeldTopics()
    driver = driver_on(topics, watchdog=watchdog)
    sign = {"stamp": {"sec": 1, "nanosec": 0}}
    driver._clock.start_thread(lambda: driver._take_sign(sign), "a sign of life")
    with driver:
        topics.silent_s = GONE_S + 0.01
        with pytest.raises(DriveError, match=f"has not answered.*{who}"):
            driver.sense()
        topics.silent_s, topics.refusal = 0.0, "geometry_msgs/msg/TwistStamped is expected"
        topics.published.clear()
        driver.stop()
        with pytest.raises(DriveError, match="TwistStamped is expected"):
            driver.send_action(Action.FORWARD)
        assert not any(speeds(topics.published[0][1]))


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("cmd_vel_topic", "/a b"),
        ("advice_topic", "a//b"),
        ("body_moves", "forward,push"),
        ("peers", "b"),
        ("interface", "eth0"),
    ],
)
def test_bad_options_are_refused_with_their_name(option: str, value: object) -> None:
    with pytest.raises(ConfigurationError, match="--" + option.replace("_", "-")):
        RosDriver(RosOptions(**{option: value}))
    with pytest.raises(ConfigurationError, match="--image-topic"):
        RosCameraOptions(image_topic="/a b")


@pytest.mark.parametrize(
    ("broken", "says"),
    [
        ({"format": "png", "data": "iVBORw0KGgo="}, "'png', which is not JPEG"),
        ({"format": "jpeg", "data": "%%%"}, "'jpeg', which is not JPEG"),
        ({"format": 7}, "'7', which is not JPEG"),
    ],
)
def test_a_topic_that_sends_something_else_is_a_fault(broken: Any, says: str) -> None:
    clock, topics = VirtualClock(), HeldTopics()
    with (
        mock.patch("robot.bodies.ros.camera.open_topics", topics.open),
        RosCamera(RosCameraOptions(address="base"), clock) as camera,
    ):
        topics.on_message("", broken)
        clock.sleep(1.0)
        assert says in str(camera.fault)
        topics.on_message("", {"data": grey_jpeg(1)})
        assert camera.fault is None
        topics.refusal = "topic /front already has type sensor_msgs/msg/Image"
        clock.sleep(1.0)
        assert topics.refusal in str(camera.fault) and "--image-topic" in str(camera.fault)


@pytest.mark.parametrize(
    ("encoding", "pixel"),
    [("rgb8", [1, 2, 3]), ("bgr8", [3, 2, 1]), ("rgba8", [1, 2, 3, 9]), ("bgra8", [3, 2, 1, 9])],
)
def test_pixels_become_rgb_and_padding_is_left_out(encoding: str, pixel: list[int]) -> None:
    row = bytes(pixel * 2) + b"pad"
    message = {"width": 2, "height": 2, "step": len(row), "encoding": encoding}
    picture = read_pixels(message, 2 * row)
    assert (picture.width, picture.height, picture.data) == (2, 2, bytes([1, 2, 3] * 4))
    grey = {"width": 2, "height": 1, "step": 2, "encoding": "mono8"}
    assert read_pixels(grey, b"\5\6").data == b"\5\5\5\6\6\6"
    for wrong in ({"width": 0}, {"step": 1}, {"encoding": "32FC1"}, {"height": 9}):
        with pytest.raises((ValueError, KeyError)):
            read_pixels(message | wrong, 2 * row)


# Over a real socket ----------------------------------------------------------------------------


def driver_for(ros: RosBridgeServer) -> RosDriver:
    return RosDriver(RosOptions(address=ros.address))


@pytest.mark.realtime
def test_a_base_is_driven_watched_and_lost(caplog: pytest.LogCaptureFixture) -> None:
    a_missing_bridge_is_reported_in_a_sentence()
    with RosBridgeServer() as ros:
        check_real_camera(RosCamera(RosCameraOptions(address=ros.address), RealClock()))
        driver = driver_for(ros)

        def is_moving() -> bool:
            ros.settle(driver._connection)
            return ros.is_moving

        check_real_driver(driver, is_moving)
        a_velocity_that_is_not_renewed_is_followed_by_zero(ros)
        a_silent_bridge_is_connected_again(ros)
        caplog.set_level(logging.WARNING, "robot.bodies.ros")
        a_refusal_is_an_error_until_the_bridge_accepts_the_topic(ros, caplog)


def a_missing_bridge_is_reported_in_a_sentence() -> None:
    options = {"address": "127.0.0.1:9"}
    with pytest.raises(DriveError, match="rosbridge_server"):
        RosDriver(RosOptions(**options)).connect()
    with pytest.raises(CameraError, match=r"127\.0\.0\.1:9"):
        RosCamera(RosCameraOptions(**options), RealClock()).start()


def a_velocity_that_is_not_renewed_is_followed_by_zero(ros: RosBridgeServer) -> None:
    """This base never stops by itself, so only a velocity of zero ends the move."""
    with driver_for(ros) as driver:
        ros.settle(driver._connection)
        before = len(ros.cmd_vel)
        driver.send_action(Action.FORWARD)
        wait_until(lambda: [any(speeds(m)) for m in ros.cmd_vel[before:]][:2] == [True, False])


def a_silent_bridge_is_connected_again(ros: RosBridgeServer) -> None:
    with mock.patch("robot.bodies.ros.bridge._LOST_S", 0.3), driver_for(ros) as driver:
        bridge: Any = driver._connection
        first = bridge._socket
        ros.frozen.set()
        wait_until(lambda: bridge._socket is not first)
        ros.frozen.clear()
        send_until(driver, Action.FORWARD, lambda: ros.is_moving)


def answering(operation: str, level: str, says: str) -> Callable[[dict[str, Any]], list[str]]:
    """Return answers that refuse each operation of one kind with a status."""
    status = {"op": "status", "level": level, "msg": says}

    def answers(asked: dict[str, Any]) -> list[str]:
        is_told = asked["op"] == operation
        return [json.dumps({**status, "id": asked.get("id")})] if is_told else []

    return answers


def a_refusal_is_an_error_until_the_bridge_accepts_the_topic(
    ros: RosBridgeServer, caplog: pytest.LogCaptureFixture
) -> None:
    """After the conflicting node has ended, the driver advertises the topic again, on the same
    connection."""

    def hears(driver: RosDriver, seconds: float = 30.0) -> str:
        """Return the first error of a drive, except a pause of this computer."""
        return error_while_driving(driver, seconds, but="has not answered")

    says = "Topic /cmd_vel already established with type geometry_msgs/msg/TwistStamped"
    with driver_for(ros) as driver:
        ros.answers = answering("publish", "warning", "slow")
        driver.send_action(Action.FORWARD)
        wait_until(lambda: "rosbridge warns: publish:/cmd_vel: slow" in caplog.text)
        assert not hears(driver, 0.1)
    ros.answers = answering("advertise", "error", says)
    with driver_for(ros) as driver:
        said = hears(driver)
        assert says in said and said.endswith("start with --stamped true")
        time.sleep(1.2 * REFUSED_S)
        assert hears(driver) == said, "rosbridge still refuses the topic"
        ros.answers = lambda asked: []
        wait_until(lambda: not hears(driver, 0.05))


@pytest.mark.realtime
def test_a_foreign_client_hears_what_we_say() -> None:
    """CI installs `roslibpy` only for this test."""
    path = installed("roslibpy", "roslibpy")
    with RosBridgeServer() as ros:
        client = subprocess.Popen(
            [sys.executable, "-m", "tests.robot.bodies.ros.foreign_client", ros.address],
            env={**os.environ, "PYTHONPATH": str(path)},
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert client.stdout is not None
            assert client.stdout.readline().strip() == "ready"
            wait_until(lambda: bool(ros.told["/cmd_vel_foreign"]))
            theirs = ros.told["/cmd_vel_foreign"][0]
            wait_until(lambda: ros._listeners["/cmd_vel"])
            with driver_for(ros) as driver:
                send_until(driver)
                heard = [json.loads(client.stdout.readline()) for _ in range(2)]
        finally:
            client.kill()
            client.communicate()
    assert [speeds(message) for message in heard] == [(0.0, 0.0), (0.2, 0.0)]
    assert {part: set(theirs[part]) for part in theirs} == {
        part: set(heard[1][part]) for part in heard[1]
    }, "the fields are equal"
