"""A ROS robot over DDS: messages (compared with a third-party codec), options, and the network."""

from __future__ import annotations

import logging
import struct
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from robot.bodies.ros.camera import RosCamera, RosCameraOptions
from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.bodies.ros.suggestion import Endpoint, suggest
from robot.bodies.ros.topics import COMPRESSED, HEADER, ODOMETRY, RANGE, RAW, STAMPED, TEXT, TWIST
from robot.bodies.ros.transport import open_topics
from robot.clock import RealClock
from robot.errors import ConfigurationError, DriveError, MissingExtraError
from robot.testing.camera_contract import CameraContract
from robot.testing.cases import CameraCase, DriverCase
from robot.types import Action, Point
from tests.contract.real_parts import (
    SHORT,
    WHOLE,
    check_real_camera,
    check_real_case,
    on_a_busy_machine,
)
from tests.kit.sizes import IS_FULL
from tests.kit.wait import wait_until

pytest.importorskip("cyclonedds", reason="cyclonedds has no wheel for this Python or processor")
pytest.importorskip("rosbags", reason="rosbags is not installed, which decodes the messages")
from rosbags.typesys import Stores, get_typestore

from robot.bodies.ros import dds
from robot.bodies.ros.messages import TYPES, dds_topic, from_dds, ros_topic, ros_type, to_dds
from tests.standins.dds_robot import BASE, IMAGES, DdsRobot, own_domain

VALUES: dict[str, Any] = {"int32": -7, "uint32": 9, "uint8": 3, "float32": 0.5, "float64": -0.25}


def example(store: Any, kind: str) -> Any:
    """Make a rosbags message of this type, with another value in each field."""

    def value(form: Any) -> Any:
        node, details = form
        if node.name == "BASE":
            return VALUES.get(details[0], "größer")
        if node.name == "NAME":
            return example(store, details)
        inner, length = details
        name = inner[1][0]
        kinds = {"uint8": np.uint8, "float64": np.float64}
        return np.arange(length or 5, dtype=kinds[name])

    return store.types[kind](*[value(form) for _, form in store.get_msgdef(kind).fields])


def plain(message: Any) -> Any:
    """Return the fields of a rosbags message."""
    if hasattr(message, "__dataclass_fields__"):
        names = [name for name in message.__dataclass_fields__ if name != "__msgtype__"]
        return {name: plain(getattr(message, name)) for name in names}
    return list(message.tolist()) if isinstance(message, np.ndarray) else message


@pytest.mark.parametrize("store", [Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY])
@pytest.mark.parametrize("kind", sorted(TYPES))
def test_messages_equal_those_of_a_third_party_codec(kind: str, store: Stores) -> None:
    types = get_typestore(store)
    theirs = example(types, kind)
    ours = from_dds(TYPES[kind].deserialize(bytes(types.serialize_cdr(theirs, kind))))
    told = {name: list(one) if isinstance(one, bytes) else one for name, one in ours.items()}
    wanted = plain(theirs)
    wanted = {name: value for name, value in wanted.items() if name.islower()}
    wanted.pop("variance", None)
    assert told == wanted
    if kind in (TWIST, STAMPED, TEXT, HEADER):
        data = to_dds(TYPES[kind], ours).serialize()
        assert plain(types.deserialize_cdr(data, kind)) == wanted


def test_names_of_topics_and_types_are_those_of_ros() -> None:
    assert dds_topic("/cmd_vel") == dds_topic("cmd_vel") == "rt/cmd_vel"
    assert (ros_topic("rt/a/b"), ros_topic("rq/a"), ros_topic("DCPSTopic")) == ("/a/b", None, None)
    assert {ros_type(kind.__idl_typename__) for kind in TYPES.values()} == set(TYPES)
    assert ros_type("HelloWorld") == "HelloWorld"


@pytest.mark.parametrize("kind", [COMPRESSED, RAW])
def test_a_cut_off_picture_is_an_error(kind: str) -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    data = bytes(types.serialize_cdr(example(types, kind), kind))
    for length in range(4, len(data) - 4):
        with pytest.raises((ValueError, IndexError, struct.error)):
            TYPES[kind].deserialize(data[:length])


def test_peers_are_queried_by_unicast_without_a_time_limit() -> None:
    text = dds.configuration(["127.0.0.1", "localhost"], "")
    assert text.count('<Peer Address="127.0.0.1" PruneDelay="inf"/>') == 2
    assert "<AllowMulticast>false" in text and 'address="127.0.0.1"' in text
    assert "name='wlan\"0'" in dds.configuration([], 'wlan"0')
    assert "Multicast" not in dds.configuration([], "") and "Peer" not in dds.configuration([], "")
    with pytest.raises(DriveError, match=r"'nowhere\.invalid' is unknown.*--address"):
        dds.configuration(["nowhere.invalid"], "")


def test_options_of_one_transport_are_refused_by_the_other() -> None:
    assert RosOptions(transport="dds", address="a", peers="b, a,,c").hosts == ("a", "b", "c")
    for options in (
        {"transport": "dds", "address": "robot:9090"},
        {"transport": "dds", "domain": 233},
        {"transport": "dds", "odometry_topic": "a b"},
    ):
        with pytest.raises(ConfigurationError, match="--"):
            RosOptions(**options)


def test_without_the_library_a_sentence_names_rosbridge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    with pytest.raises(MissingExtraError, match=r"--transport rosbridge.*drivelesson\[dds\]"):
        RosDriver(RosOptions(transport="dds")).connect()


def test_the_found_topics_suggest_the_options() -> None:
    def words(*seen: tuple[str, str, bool]) -> str:
        return " ".join(suggest(Endpoint(*each) for each in seen))

    assert words() == words((BASE, TWIST, False), (BASE, TWIST, True)) == ""
    assert words((BASE, STAMPED, False)) == "--stamped true"
    assert words(("/b/cmd_vel", TWIST, False), ("/c/base/cmd_vel", TWIST, False)) == (
        "--cmd-vel-topic /b/cmd_vel"
    )
    assert words(("/drivelesson/cmd_vel", STAMPED, False), (BASE, TWIST, False)) == (
        "--watchdog true"
    )
    assert words(
        ("/d/depth/compressed", COMPRESSED, True), ("/camera/rgb/compressed", COMPRESSED, True)
    ) == ("--image-topic /camera/rgb/compressed")
    assert words(("/image", RAW, True), ("/other", RAW, False), ("/odom", ODOMETRY, True)) == (
        "--image-topic /image --image-type raw --odometry-topic /odom"
    )
    assert words(("/ir/front", RANGE, True)) == "--range-topic /ir/front"


# On the network --------------------------------------------------------------------------------


def driver_for(**options: Any) -> RosDriver:
    return RosDriver(
        RosOptions(transport="dds", address="127.0.0.1", domain=own_domain(), **options)
    )


@contextmanager
def base_case() -> Iterator[DriverCase]:
    """A robot in another process: a base that never stops by itself, behind our watchdog."""
    with DdsRobot(own_domain()) as robot:
        driver = driver_for(watchdog=True)

        def drives() -> Point:
            time.sleep(0.05)  # DDS does not confirm that a message was received
            return robot.drives

        yield on_a_busy_machine(
            driver,
            lambda: any(drives()),
            cut_link=robot.frozen.set,
            restore_link=robot.frozen.clear,
            drives=drives,
        )
        driver.disconnect()


def the_camera_keeps_the_contract() -> None:
    with DdsRobot(own_domain()) as robot:
        options = RosCameraOptions(transport="dds", address="127.0.0.1", domain=own_domain())
        camera = RosCamera(options, RealClock())
        check_real_camera(camera)
        case = CameraCase(camera, robot.frozen.set, robot.frozen.clear)
        CameraContract().test_a_source_that_was_frozen_is_seen_again(case)


@pytest.mark.realtime
def test_a_robot_on_dds_is_driven_seen_and_lost(caplog: pytest.LogCaptureFixture) -> None:
    check_real_case(base_case, WHOLE if IS_FULL else SHORT)
    the_camera_keeps_the_contract()
    a_listener_for_another_type_is_reported()
    other_nodes_on_the_topic_are_logged(caplog)


def a_listener_for_another_type_is_reported() -> None:
    with DdsRobot(own_domain()) as robot:
        stamped = robot.reader("/base/cmd_vel", STAMPED)
        driver = driver_for(cmd_vel_topic="/base/cmd_vel")
        with pytest.raises(
            DriveError, match=r"TwistStamped on the robot.*start with --stamped true"
        ):
            driver.connect()
        assert not driver.is_connected
        del stamped
        with pytest.raises(DriveError, match=r"nothing subscribes to /nobody, but there are \d"):
            driver_for(cmd_vel_topic="/nobody").connect()
        found = dds.neighbours_of(own_domain(), ["127.0.0.1"], "", RealClock(), 0.2)
        assert suggest(found) == ["--watchdog", "true"]
        with pytest.raises(DriveError, match="already uses ROS domain"):
            dds.neighbours_of(own_domain(), [], "", RealClock(), 0.2)


def other_nodes_on_the_topic_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "robot.bodies.ros")
    with DdsRobot(own_domain()) as robot, driver_for(watchdog=True) as driver:
        other = robot.writer("/drivelesson/cmd_vel", STAMPED)
        wait_until(lambda: "another node publishes /drivelesson/cmd_vel, too" in caplog.text)
        driver.send_action(Action.FORWARD)
        wait_until(lambda: any(robot.drives))
        del other
    a_publisher_that_leaves_sends_nothing_more()


def a_publisher_that_leaves_sends_nothing_more() -> None:
    """When a publisher leaves, DDS delivers a sample without fields."""
    told: list[set[str]] = []
    listening = open_topics(
        RosOptions(transport="dds", address="127.0.0.1", domain=own_domain()),
        RealClock(),
        advertised={},
        subscribed={IMAGES: COMPRESSED},
        on_message=lambda topic, message: told.append(set(message)),
    )
    with DdsRobot(own_domain()):
        wait_until(lambda: told)
    wait_until(lambda: f"nothing publishes {IMAGES}" in listening.refusal)
    listening.close()
    assert all(fields == {"header", "format", "data"} for fields in told)
