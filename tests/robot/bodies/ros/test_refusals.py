"""Every refusal of a rosbridge becomes an error in rosbridge's own words.

The answers are generated; DRIVELESSON_FULL=1 draws 200 of them (.ci/run).
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import logging
import random
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import pytest
import websockets

from robot.bodies.ros.camera import RosCamera, RosCameraOptions
from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.bodies.ros.refusals import REFUSED_S, Refusals, Unwrapping, advice_for
from robot.clock import RealClock
from robot.errors import DriveError
from robot.testing.driver_contract import DriverContract
from robot.types import Action
from tests.contract.real_parts import SMOKE, WHOLE, ros_driver_on
from tests.kit.loops import LoopThread
from tests.kit.sizes import IS_FULL
from tests.kit.wait import wait_until

ANSWERS = 200 if IS_FULL else 24
TEXTS = (
    "Topic /cmd_vel already established with type geometry_msgs/msg/TwistStamped",
    "advertise: type geometry_msgs/msg/Twist does not exist",
    "Unable to import nav_msgs.msg from package nav_msgs",
    "Message type geometry_msgs/msg/Twist does not match existing type std_msgs/msg/String",
    "/cmd_vel is not in topics_glob: not allowed",
    "geschlossen – 禁止",
    "x" * 2000,
)


@dataclass
class Answer:
    """The answers to one operation, and whether they are a refusal."""

    operation: str
    texts: list[str]
    says: str = ""
    late_s: float = 0.0
    warns: list[str] = field(default_factory=list)


def text_as_png(text: str) -> str:
    """Write a text as rosbridge's png_compression does: bytes as pixels, padded with newlines."""
    data = text.encode()
    width = max(1, int((len(data) / 3) ** 0.5))
    height = -(-len(data) // (3 * width))
    pixels = np.frombuffer(data.ljust(3 * width * height, b"\n"), np.uint8)
    picture = pixels.reshape(height, width, 3)[:, :, ::-1]
    return base64.b64encode(cv2.imencode(".png", picture)[1].tobytes()).decode()


def in_fragments(text: str, parts: int, chance: random.Random) -> list[str]:
    size = -(-len(text) // parts)
    cut = [text[at : at + size] for at in range(0, len(text), size)]
    found = [
        json.dumps({"op": "fragment", "id": "7", "data": data, "num": num, "total": len(cut)})
        for num, data in enumerate(cut)
    ]
    chance.shuffle(found)
    return found


def make(seed: int) -> Answer:
    chance = random.Random(seed)
    operation = chance.choice(["advertise", "publish"])
    level = chance.choice(["error", "error", "error", "warning", "info", "none", "ERROR", "fatal"])
    says = chance.choice(TEXTS)
    status: dict[str, Any] = {"op": "status", "level": level, "msg": says}
    if chance.random() < 0.3:
        status["id"] = "ours"  # replaced by what was asked
    text, texts = json.dumps(status), []
    form = chance.choice(["plain", "plain", "fragments", "png", "png in fragments", "after noise"])
    if "png" in form:
        text = json.dumps({"op": "png", "data": text_as_png(text)})
    if form == "after noise":
        texts = ["{", "[]", '"status"', '{"op": 7}', '{"op": "png", "data": "%%"}', "[" * 3000]
    texts += in_fragments(text, chance.randint(2, 9), chance) if "fragm" in form else [text]
    is_refused = level not in ("warning", "info", "none")
    return Answer(
        operation,
        texts,
        says[:200] if is_refused else "",
        chance.choice([0.0, 0.0, 0.1]),
        [says[:200]] if level == "warning" else [],
    )


class RefusingBridge:
    """A rosbridge that answers each operation of one kind with `answer`."""

    def __init__(self) -> None:
        self.answer = Answer("", [])
        self.asked: list[str] = []

    @contextlib.contextmanager
    def running(self) -> Iterator[RefusingBridge]:
        loop = LoopThread()
        port = loop.serve(
            lambda: websockets.serve(
                self._talk, "127.0.0.1", 0, close_timeout=0.1, ping_interval=None
            )
        )
        self.address = f"127.0.0.1:{port}"
        try:
            yield self
        finally:
            loop.close()

    async def _talk(self, socket: Any, path: str = "") -> None:
        with contextlib.suppress(websockets.ConnectionClosed):
            async for data in socket:
                asked = json.loads(data)
                self.asked.append(asked["op"])
                if asked["op"] == self.answer.operation:
                    await asyncio.sleep(self.answer.late_s)
                    for text in self.answer.texts:
                        await socket.send(text.replace('"id": "ours"', f'"id": "{asked["id"]}"'))


@pytest.fixture(scope="module")
def bridge() -> Iterator[RefusingBridge]:
    with RefusingBridge().running() as running:
        yield running


def warned(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [text for text in caplog.messages if "rosbridge warns" in text]


def hears(driver: RosDriver, seconds: float) -> str:
    """Drive as the loop does; return the first error, except a pause of this computer."""
    start_s = time.monotonic()
    while time.monotonic() - start_s < seconds:
        try:
            driver.send_action(Action.FORWARD)
            driver.sense()
        except DriveError as error:
            if "has not answered" not in str(error):
                return str(error)
        time.sleep(0.01)
    return ""


@pytest.mark.realtime
def test_each_refusal_is_heard_and_named(
    bridge: RefusingBridge, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING, "robot.bodies.ros")
    for seed in range(ANSWERS):
        bridge.answer = answer = make(seed)
        caplog.clear()
        with RosDriver(RosOptions(address=bridge.address)) as driver:
            said = hears(driver, 30.0 if answer.says else 0.15)
            if answer.warns:
                wait_until(lambda: warned(caplog))
        assert answer.says in said if answer.says else not said, (seed, answer, said)
        if answer.warns:
            [told] = {*warned(caplog)}
            assert answer.warns[0] in told, seed
    the_drivers_suite_passes_whatever_else_is_said()
    the_drivers_suite_notices_a_refusal()
    a_refusal_ends_when_the_bridge_takes_it(bridge)
    a_refused_picture_is_the_cameras_fault(bridge)


def answering(chance: random.Random, *, refuses: bool) -> Callable[[dict[str, Any]], list[str]]:
    """Answer each operation with the drawn messages: only refusals, or none."""

    def answers(asked: dict[str, Any]) -> list[str]:
        while bool((drawn := make(chance.randrange(10**6))).says) != refuses:
            pass
        return [text.replace('"id": "ours"', f'"id": "{asked.get("id")}"') for text in drawn.texts]

    return answers


def the_drivers_suite_passes_whatever_else_is_said() -> None:
    for number, check in enumerate(WHOLE if IS_FULL else SMOKE):
        with ros_driver_on(answering(random.Random(number), refuses=False)) as case:
            check(DriverContract(), case)


def the_drivers_suite_notices_a_refusal() -> None:
    with (
        ros_driver_on(answering(random.Random(1), refuses=True)) as case,
        pytest.raises(DriveError, match="refuses: "),
    ):
        DriverContract().test_every_move_moves_and_stop_stops(case)


def a_refusal_ends_when_the_bridge_takes_it(bridge: RefusingBridge) -> None:
    """The conflicting node may end: then the topic is requested again, without a new connection."""
    text = json.dumps({"op": "status", "level": "error", "msg": TEXTS[0]})
    bridge.answer = Answer("advertise", [text])
    with RosDriver(RosOptions(address=bridge.address)) as driver:
        said = hears(driver, 30.0)
        assert said.endswith("start with --stamped true")
        time.sleep(1.2 * REFUSED_S)
        assert hears(driver, 30.0) == said, "it is refused still"
        bridge.answer = Answer("", [])
        deadline_s = time.monotonic() + 30.0
        while hears(driver, 0.05):
            assert time.monotonic() < deadline_s


def a_refused_picture_is_the_cameras_fault(bridge: RefusingBridge) -> None:
    says = "topic /camera already has type sensor_msgs/msg/Image"
    text = json.dumps({"op": "status", "level": "error", "msg": says})
    bridge.answer = Answer("subscribe", [text])
    with RosCamera(RosCameraOptions(address=bridge.address), RealClock()) as camera:
        deadline_s = time.monotonic() + 30.0
        while says not in (camera.fault or ""):
            assert time.monotonic() < deadline_s, camera.fault
            time.sleep(0.01)
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


def test_what_is_said_to_do_fits_what_was_asked() -> None:
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
