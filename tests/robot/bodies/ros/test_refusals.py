"""Every refusal of a rosbridge becomes an error in rosbridge's own words."""

from __future__ import annotations

import base64
import json
import logging
import random
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from robot.bodies.ros.camera import RosCamera, RosCameraOptions
from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.bodies.ros.refusals import REFUSED_S, Refusals, Unwrapping, advice_for
from robot.clock import RealClock
from robot.types import Action
from tests.kit.sizes import crossed
from tests.kit.wait import wait_until
from tests.robot.bodies.sending import error_while_driving
from tests.standins.rosbridge import RosBridgeServer

TEXTS = (
    "Topic /cmd_vel already established with type geometry_msgs/msg/TwistStamped",
    "advertise: type geometry_msgs/msg/Twist does not exist",
    "Unable to import nav_msgs.msg from package nav_msgs",
    "Message type geometry_msgs/msg/Twist does not match existing type std_msgs/msg/String",
    "/cmd_vel is not in topics_glob: not allowed",
    "geschlossen – 禁止",
    "x" * 2000,
)
REFUSES = {"error": True, "ERROR": True, "fatal": True, "warning": False, "info": False}
NOISE = ("{", "[]", '"status"', '{"op": 7}', '{"op": "png", "data": "%%"}', "[" * 3000)


def text_as_png(text: str) -> str:
    """Write a text as rosbridge's png_compression does: bytes as pixels, padded with newlines."""
    data = text.encode()
    width = max(1, int((len(data) / 3) ** 0.5))
    height = -(-len(data) // (3 * width))
    pixels = np.frombuffer(data.ljust(3 * width * height, b"\n"), np.uint8)
    picture = pixels.reshape(height, width, 3)[:, :, ::-1]
    return base64.b64encode(cv2.imencode(".png", picture)[1].tobytes()).decode()


def in_fragments(text: str) -> list[str]:
    """Cut a message into seven parts, which arrive in any order."""
    size = -(-len(text) // 7)
    cut = [text[at : at + size] for at in range(0, len(text), size)]
    found = [
        json.dumps({"op": "fragment", "id": "7", "data": data, "num": num, "total": len(cut)})
        for num, data in enumerate(cut)
    ]
    random.Random(1).shuffle(found)
    return found


@crossed(
    text=TEXTS,
    level=REFUSES,
    form=["plain", "fragments", "png", "png in fragments", "after noise"],
)
def test_a_refusal_is_read_in_any_form_and_nothing_else_is_one(
    text: str, level: str, form: str, caplog: pytest.LogCaptureFixture
) -> None:
    status = json.dumps({"op": "status", "level": level, "msg": text, "id": "advertise:/cmd_vel"})
    if "png" in form:
        status = json.dumps({"op": "png", "data": text_as_png(status)})
    sent = in_fragments(status) if "fragments" in form else [status]
    sent = [*NOISE, *sent] if form == "after noise" else sent
    unwrapping, refusals = Unwrapping(), Refusals()
    messages = [message for one in sent for message in unwrapping.messages(one)]
    assert refusals.take(messages[-1], 1.0) is REFUSES[level]
    assert (text[:200] in refusals.at(1.0)) is REFUSES[level]
    assert any(text[:200] in line for line in caplog.messages) is (level == "warning")


def answering(operation: str, level: str, says: str) -> Callable[[dict[str, Any]], list[str]]:
    """Answer each operation of one kind with a status."""

    def answers(asked: dict[str, Any]) -> list[str]:
        status = {"op": "status", "id": asked.get("id"), "level": level, "msg": says}
        return [*NOISE, json.dumps(status)] if asked["op"] == operation else []

    return answers


def hears(driver: RosDriver, seconds: float = 30.0) -> str:
    """Return the first error of a drive, except a pause of this computer."""
    return error_while_driving(driver, seconds, but="has not answered")


@pytest.mark.realtime
def test_a_refusal_is_an_error_until_the_bridge_accepts_the_topic(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The conflicting node may end: then the topic is requested again, without a new connection."""
    caplog.set_level(logging.WARNING, "robot.bodies.ros")
    with RosBridgeServer() as ros:
        with RosDriver(RosOptions(address=ros.address)) as driver:
            ros.answers = answering("publish", "warning", "slow")
            driver.send_action(Action.FORWARD)
            wait_until(lambda: "rosbridge warns: publish:/cmd_vel: slow" in caplog.text)
            assert not hears(driver, 0.1)
            ros.answers = answering("publish", "error", TEXTS[4])
            assert TEXTS[4] in hears(driver)
        ros.answers = answering("advertise", "error", TEXTS[0])
        with RosDriver(RosOptions(address=ros.address)) as driver:
            said = hears(driver)
            assert TEXTS[0] in said and said.endswith("start with --stamped true")
            time.sleep(1.2 * REFUSED_S)
            assert hears(driver) == said, "it is refused still"
            ros.answers = lambda asked: []
            wait_until(lambda: not hears(driver, 0.05))
        says = "topic /front already has type sensor_msgs/msg/Image"
        ros.answers = answering("subscribe", "error", says)
        with RosCamera(
            RosCameraOptions(address=ros.address, image_topic="/front"), RealClock()
        ) as camera:
            wait_until(lambda: says in (camera.fault or ""))
            assert "--image-topic" in str(camera.fault)


def test_a_refusal_counts_for_a_second_and_a_warning_is_written_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    refusals = Refusals()
    warning = {"op": "status", "level": "warning", "msg": "slow"}
    assert not any(refusals.take(warning, 1.0) for _ in range(5))
    assert caplog.messages == ["rosbridge warns: slow"] and not refusals.at(1.0)
    assert refusals.take({"id": "publish:/a", "msg": 7}, 2.0), "no level: it is in doubt"
    assert refusals.at(2.0 + 0.9 * REFUSED_S) == "publish:/a: 7"
    assert not refusals.at(2.0 + REFUSED_S)


def test_the_advice_fits_the_refused_request() -> None:
    for said, is_stamped, has_watchdog, do in (
        (TEXTS[0], False, False, "--stamped true"),
        (TEXTS[0], True, False, "another topic"),
        ("has type geometry_msgs/msg/Twist", True, False, "leave --stamped out"),
        ("has type geometry_msgs/msg/Twist", True, True, "watchdog"),
        (TEXTS[4], False, False, "topics_glob"),
        ("no idea", False, False, ""),
    ):
        assert do in advice_for(said, is_stamped=is_stamped, has_watchdog=has_watchdog), said


def test_fragments_that_never_end_are_dropped() -> None:
    unwrapping = Unwrapping()
    for key in range(40):
        part = {"op": "fragment", "id": key, "data": "x" * 2**18, "num": 0, "total": 2}
        assert not list(unwrapping.messages(json.dumps(part)))
    kept = sum(len(data) for parts in unwrapping._parts.values() for data in parts.values())
    assert kept <= 6 * 2**20
    for total in (-1, 0, 10**9, "many", None):
        part = {"op": "fragment", "id": 1, "data": "x", "num": 0, "total": total}
        assert not list(unwrapping.messages(json.dumps(part)))
