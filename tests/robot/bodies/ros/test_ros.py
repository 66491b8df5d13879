"""A ROS robot over a small rosbridge: velocities, pictures, advice, and their absence."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any
from unittest import mock

import pytest

from robot.bodies.ros.camera import RosCamera, RosCameraOptions
from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.clock import RealClock
from robot.control.config import LoopConfig
from robot.devices.driver_thread import DriverThread
from robot.devices.rig import Rig
from robot.errors import CameraError, ConfigurationError, DriveError
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.types import Action
from tests.contract.real_parts import (
    check_camera_on_its_real_line,
    check_driver_on_its_real_line,
)
from tests.kit.needed import installed
from tests.kit.wait import wait_until
from tests.robot.bodies.sending import send_until
from tests.standins.firmware import ROOT
from tests.standins.rosbridge import RosBridgeServer, grey_image

ADVICE = "/drivelesson/advice"


@pytest.fixture
def ros() -> Iterator[RosBridgeServer]:
    with RosBridgeServer() as running:
        yield running


def driver_for(ros: RosBridgeServer, **options: Any) -> RosDriver:
    return RosDriver(RosOptions(address=ros.address, **options))


def speeds(message: dict[str, Any]) -> tuple[float, float]:
    twist = message.get("twist", message)
    return twist["linear"]["x"], twist["angular"]["z"]


@pytest.mark.realtime
def test_a_base_is_driven_watched_and_lost(ros: RosBridgeServer) -> None:
    """One bridge is used for all of this."""
    check_driver_on_its_real_line("ros")
    check_camera_on_its_real_line("ros")
    a_bridge_that_is_not_there_is_a_sentence()
    moves_are_velocities_in_metres_and_radians(ros)
    a_velocity_that_is_not_renewed_is_followed_by_zero(ros)
    a_topic_that_sends_something_else_is_a_fault(ros)
    what_the_learner_would_do_is_a_topic(ros)
    without_a_bridge_the_driver_says_what_that_means(ros)
    a_bridge_without_a_sign_of_life_is_connected_anew(ros)


def moves_are_velocities_in_metres_and_radians(ros: RosBridgeServer) -> None:
    moves = "forward,left,spin_right,fast:0:1,half_left:-0.5:0.25"
    with driver_for(ros, linear_mps=0.4, turn_rate_deg_s=90.0, body_moves=moves) as driver:
        ros.settle(driver._connection)
        assert ros.topics["/cmd_vel"] == "geometry_msgs/msg/Twist"
        ros.cmd_vel.clear()
        for move in driver.moves:
            driver.send_action(move, speed_scale=0.5)
        driver.send_action(Action.STOP)
        ros.settle(driver._connection)
    turn = math.pi / 2
    wanted = [(0.1, 0), (0.1, turn / 2), (0, -turn / 2), (0.2, 0), (0.05, turn / 4)]
    told = [pair for pair in map(speeds, ros.cmd_vel) if any(pair)]
    assert told == [pytest.approx(pair) for pair in wanted]
    assert not any(speeds(ros.cmd_vel[-1]))


def test_stamped_velocities_carry_the_time() -> None:
    clock, bridge = VirtualClock(), mock.Mock()
    bridge.return_value.silent_s, bridge.return_value.refusal = 0.0, ""
    options = RosOptions(address="base", stamped=True)
    driver = RosDriver(options, clock)
    driver.open_topics = bridge
    with driver:
        driver.send_action(Action.FORWARD)
    assert bridge.call_args.kwargs["advertised"] == {"/cmd_vel": "geometry_msgs/msg/TwistStamped"}
    *_, (topic, message, (end, for_s)) = (
        call.args for call in bridge.return_value.publish.call_args_list if call.args[2] is not None
    )
    assert (topic, for_s, speeds(message), speeds(end)) == ("/cmd_vel", 0.4, (0.2, 0), (0, 0))
    stamp = message["header"]["stamp"]
    assert stamp["sec"] + stamp["nanosec"] / 1e9 == pytest.approx(clock.wall_s(), abs=1e-3)


def a_velocity_that_is_not_renewed_is_followed_by_zero(ros: RosBridgeServer) -> None:
    """This base never stops by itself, so our zero ends the move."""
    with mock.patch.object(ros, "has_timeout", False), driver_for(ros) as driver:
        ros.settle(driver._connection)
        before = len(ros.cmd_vel)
        driver.send_action(Action.FORWARD)
        ros.wait_until(lambda: [any(speeds(m)) for m in ros.cmd_vel[before:]][:2] == [True, False])


def without_a_bridge_the_driver_says_what_that_means(ros: RosBridgeServer) -> None:
    with driver_for(ros) as driver:
        ros.frozen.set()
        with pytest.raises(DriveError, match=r"only the robot's own base can stop it now"):
            for _ in range(500):
                driver.sense()
                time.sleep(0.01)
        ros.frozen.clear()

        send_until(driver, Action.FORWARD, lambda: ros.is_moving)


def a_bridge_without_a_sign_of_life_is_connected_anew(ros: RosBridgeServer) -> None:
    with mock.patch("robot.bodies.ros.bridge._LOST_S", 0.3), driver_for(ros) as driver:
        bridge: Any = driver._connection
        first = bridge._socket
        ros.frozen.set()
        wait_until(lambda: bridge._socket is not first)
        ros.frozen.clear()
        send_until(driver, Action.FORWARD, lambda: ros.is_moving)


def a_bridge_that_is_not_there_is_a_sentence() -> None:
    options = {"address": "127.0.0.1:9"}
    with pytest.raises(DriveError, match="rosbridge_server"):
        RosDriver(RosOptions(**options)).connect()
    with pytest.raises(CameraError, match=r"127\.0\.0\.1:9"):
        RosCamera(RosCameraOptions(**options), RealClock()).start()


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("linear_mps", 0.0),
        ("linear_mps", math.nan),
        ("turn_rate_deg_s", 1e9),
        ("cmd_vel_topic", ""),
        ("cmd_vel_topic", "/a b"),
        ("advice_topic", "a//b"),
        ("body_moves", "forward,push"),
    ],
)
def test_bad_options_are_refused_with_their_name(option: str, value: object) -> None:
    with pytest.raises(ConfigurationError, match="--" + option.replace("_", "-")):
        RosDriver(RosOptions(**{option: value}))
    with pytest.raises(ConfigurationError, match="--image-topic"):
        RosCameraOptions(image_topic="/a b")


def a_topic_that_sends_something_else_is_a_fault(ros: RosBridgeServer) -> None:
    with RosCamera(RosCameraOptions(address=ros.address), RealClock()) as camera:
        wait_until(camera.latest)
        for broken, says in (
            ({"format": "png", "data": "iVBORw0KGgo="}, "'png', which is not JPEG"),
            ({"format": "jpeg", "data": "%%%"}, "which is not JPEG"),
            ({"format": 7}, "which is not JPEG"),
        ):
            ros.images = lambda index, broken=broken: broken
            wait_until(lambda says=says: camera.fault is not None and says in camera.fault)
            ros.images = grey_image
            wait_until(lambda: camera.fault is None)


def what_the_learner_would_do_is_a_topic(ros: RosBridgeServer) -> None:
    """Nobody starts the robot: it only gives advice."""
    ros.cmd_vel.clear()
    driver = driver_for(ros, advice_topic=ADVICE)
    clock = RealClock()
    camera = RosCamera(RosCameraOptions(address=ros.address), clock)
    policy = make_policy("default-32", moves=(Action.FORWARD, Action.LEFT))
    rig = Rig(DriverThread(driver, clock), camera, policy, clock, LoopConfig())
    with rig:
        ros.wait_until(lambda: len(ros.told[ADVICE]) >= 3)
    told = [json.loads(message["data"]) for message in ros.told[ADVICE]]
    assert ros.topics[ADVICE] == "std_msgs/msg/String"
    assert all(set(each) == {"move", "confidence", "novel", "frame"} for each in told)
    frames = [each["frame"] for each in told]
    assert frames == sorted(set(frames)), "one of each picture at most"
    assert not any(any(speeds(message)) for message in ros.cmd_vel), "and it never moved"


@pytest.mark.realtime
def test_a_foreign_client_hears_what_we_say(ros: RosBridgeServer) -> None:
    """CI installs `roslibpy` only for this test."""
    path = installed("roslibpy", "roslibpy")
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
        ros.wait_until(lambda: bool(ros.told["/cmd_vel_foreign"]))
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
    }, "the same message, field by field"
